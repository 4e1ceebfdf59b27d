"""Comparisons on common random numbers: `runs` makes them, `statistics` reads them, `report` shows them.

In: names of scenarios, trackers, seeds, and settings. Out: Parquet rows of every run, tables with intervals, a page.
"""
