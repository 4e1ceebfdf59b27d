"""Experiments of the papers, one folder each, with the paper's figures beside ours and an answer on each claim.

In: a number of runs and a seed. Out: answers, tables and figures (`testbed reproduce PAPER`). May import everything
but `testbed.experiments` and `studies`.
"""
