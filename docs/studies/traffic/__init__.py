"""The page docs/traffic.md: sizes, gaps and speeds of our traffic beside those of real traffic."""
