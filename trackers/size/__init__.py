"""Size of each object from both of its ends: a grid Bayes filter of length and width beside any filter of the place.

In: the detections of each object and the box that its filter has. Out: size, its uncertainty, class, and the centre
that goes with them. Equations: docs/methods/size-from-both-ends.md.
"""
