"""Recorded traffic as scenarios, `replay:FILE`; docs/real-traffic.md.

In: a CSV of trajectories in one of the layouts of `layouts`. Out: a `Scenario`. Only `road` loads highway-env.
"""
