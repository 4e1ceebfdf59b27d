"""How a body moves, and what range rates say of it: the coordinated turn, and motion modes over a contour filter.

Equations: docs/methods/motion-modes.md.
"""
