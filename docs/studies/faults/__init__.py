"""The page docs/faults.md: what faults of the radar cost trackers."""
