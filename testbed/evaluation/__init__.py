"""Scores: estimates held against the truth, frame by frame.

In: a `Frame` with the true scene, the detections' origin and each tracker's tracks. Out: errors, summaries and the
rows of a run's results. The one place besides the studies where truth and estimate meet. May import `testbed.log` (the
recorder feeds the log), shapely, `testbed.frame` and `testbed.files`; no simulator.
"""
