"""The laws that every entry of the catalogues keeps, as functions: of our own entries in the tests, and of a user's.

A filter, tracker, radar, planner or scenario goes in, results in words come out. It may import everything but the
studies.
"""

from testbed.check.draws import Broken
from testbed.check.report import LawResult, examine_filter, examine_tracker

__all__ = ["Broken", "LawResult", "examine_filter", "examine_tracker"]
