"""What tracking error costs in driving: paired drives on truth, on what is in view, on tracks (`testbed regret`).

In: names of scenarios, planners, trackers, injected errors, seeds. Out: one row a drive, differences with intervals,
attribution to groups of errors, a page. May import `testbed.environment`, `testbed.evaluation`, `testbed.compare` and
below.
"""
