"""Recordings as tables in a folder: those of users and of our scenarios, given to trackers as if they were live.

In go folders of Parquet or CSV files (docs/own-recordings.md), out come tracks, metrics where there is truth, and a
review log. May import everything of `testbed` but `studies`.
"""
