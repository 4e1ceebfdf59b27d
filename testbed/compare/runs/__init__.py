"""The runs of a comparison: which there are, how they are made on many processes, what is stored of each.

In: scenarios, trackers, seeds and settings. Out: recordings, rows and `runs.parquet` in the folder of the comparison.
May import `testbed.environment`, `testbed.evaluation`, `testbed.log` and below; neither `statistics` nor `report`.
"""
