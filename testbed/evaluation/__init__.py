"""Scores: estimates compared with the truth, frame by frame.

In: true scenes, the origin of the detections, and tracks. Out: a `FrameScore` a frame, summaries, and the rows of a
run's results. May import `testbed.frame` and shapely; no simulator and no log.
"""
