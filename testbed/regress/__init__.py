"""Regression of tracking results: a fixed suite of runs against committed baselines."""
