"""The page docs/modes.md: motion models against the true maneuvers."""
