"""The page docs/closed-loop.md: trackers side by side in closed loop."""
