"""Statistics of a comparison: paired differences, intervals, phases, bands of range and visible share.

In: the `Results` of a folder. Out: numbers in records and data frames. May import numpy, scipy, pandas and
`testbed.compare.runs`; draws and prints nothing.
"""
