"""The page docs/partial-view.md: what a one-sided view does to a contour model."""
