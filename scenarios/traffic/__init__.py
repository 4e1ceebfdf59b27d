"""Recorded traffic as scenarios, `replay:FILE`; docs/real-traffic.md.

In: a CSV of trajectories in one of the layouts of `layouts`. Out: a `Scenario` whose vehicles follow them. May import
what `scenarios` may; `road` loads highway-env, the others do not.
"""
