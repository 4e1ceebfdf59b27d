"""The page docs/htg-tables.md: the shipped tables, and how the model fits real detections."""
