"""Xia et al. (2020): learned hierarchical truncated Gaussians; a car that follows, turns and drives an S."""
