"""The gymnasium wrapper: any highway-env environment with a radar and trackers between the world and the planner.

In: a highway-env environment, a radar, trackers. Out: observations and a road built from tracks, and one `Frame` a scan
for observers; among these the recorder, which scores an episode and writes its log. May import highway-env,
`testbed.frame`, `testbed.evaluation`, `testbed.log` and `testbed.files`.
"""
