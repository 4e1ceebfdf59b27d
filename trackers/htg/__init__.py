"""Hierarchical truncated Gaussian trackers: density, tables, and the filters over them."""
