"""Yao et al. (2021): ellipses on a B-spline, smoothing and adaptation; a truck and a tractor on two half circles."""
