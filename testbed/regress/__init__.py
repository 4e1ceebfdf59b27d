"""Regression: every scenario and tracker compared with committed baselines (`testbed regress`).

In: the catalogues and `baselines.json`. Out: an exit status, a table of what moved, JUnit XML, the log of the worst
run. May import `testbed.compare.runs` and `testbed.compare.statistics`.
"""
