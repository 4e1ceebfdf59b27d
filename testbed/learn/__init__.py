"""Offline learning of what trackers read: tables of hierarchical truncated Gaussians, and contours.

In: detections on known vehicles (recorded, sampled from a radar of the catalogue, or real). Out: JSON. May import
scenarios, sensors, trackers and `testbed.files`.
"""
