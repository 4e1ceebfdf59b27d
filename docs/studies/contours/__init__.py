"""The page docs/contours.md: contours and classes that `pmht-spline-adaptive` learns on the way."""
