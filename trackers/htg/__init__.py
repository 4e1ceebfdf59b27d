"""Hierarchical truncated Gaussian trackers: density, tables, and the filters over them.

Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""
