"""One module a paper: its experiment, its claims, our verdict."""
