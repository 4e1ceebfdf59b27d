"""How hard a probe may be: single drives of it, and the hardest setting that a planner survives.

In: names of probes, planners and trackers. Out: measures of drives, and limits in the unit of the probe's parameter.
May import all of the testbed but the studies.
"""
