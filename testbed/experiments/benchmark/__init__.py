"""Benchmarks with a version: what is frozen by name, entries as files that can be made again, and tables of entries."""
