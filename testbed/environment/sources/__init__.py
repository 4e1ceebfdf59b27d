"""What a planner may get instead of tracks: the truth in view, injected errors, groups of errors of a tracker.

In: the text of a condition. Out: a source of tracks for `testbed.environment.perception`. docs/methods/regret.md.
"""
