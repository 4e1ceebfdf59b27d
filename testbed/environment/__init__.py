"""The gymnasium wrapper: any highway-env environment with a radar and trackers between the world and the planner.

In: a highway-env environment, a radar, trackers. Out: observations and a road built from tracks, and one `Frame` a
scan for whoever watches. May import highway-env, `testbed.frame`, `testbed.evaluation` and `testbed.log` (to record
episodes).
"""
