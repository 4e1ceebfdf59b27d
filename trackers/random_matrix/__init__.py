"""Random-matrix trackers: an ellipse with an inverse-Wishart extent (Koch, Feldmann), virtual measurements (Hoher)."""
