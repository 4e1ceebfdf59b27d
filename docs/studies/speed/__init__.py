"""What tracking costs beside the simulation: goals with verdicts, and the page docs/speed.md.

Enters: nothing but names of environments. Leaves: ratios measured side by side in one run. May import everything but
`studies`; only the module of the figure draws.
"""
