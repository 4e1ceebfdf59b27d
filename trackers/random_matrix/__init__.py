"""Random-matrix trackers: an ellipse with an inverse-Wishart extent (Koch, Feldmann), virtual measurements (Hoher).

In: a state and a `Scan`. Out: the next state. May import numpy, scipy and the modules of `trackers` beside this folder.
"""
