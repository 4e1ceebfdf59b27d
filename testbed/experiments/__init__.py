"""Studies of many runs: what one run is, how runs are made on many processes, what is kept, how it is judged.

In: scenarios, trackers, seeds. Out: a folder with a file of each run, tables, a report. `testbed compare`, `regret`,
`regress` and `probe` are a `Study` each. May import everything of the testbed but the command line.
"""
