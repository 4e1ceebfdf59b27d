"""What a study of regret shows: tables, figures, the page, logs of the worst pairs."""
