"""Comparisons of trackers: many seeds, common random numbers, statistics, figures and a report."""
