"""What the commands share on the terminal: console, progress bars, tables, Ctrl-C.

In: results as plain records. Out: text for people. May import rich and typer, and of testbed its labels, the log
and the planners' catalogue; the commands themselves are in `testbed.cli`.
"""
