"""Offline learning of what trackers ship: tables of hierarchical truncated Gaussians, contours, classes.

In: detections on known vehicles (recorded, sampled from a radar of the catalogue, or real). Out: JSON that
`trackers.htg.bins` and `trackers.pmht.model` read. May import scenarios, sensors, trackers and `testbed.files`.
"""
