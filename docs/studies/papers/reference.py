"""Figures that ours stand beside, of a paper or of an independent implementation: PAPER/reference.csv.

A row is a method in a case, a column a measure of ours; what is not known is empty.
"""

import csv
from collections.abc import Mapping
from pathlib import Path

Figures = Mapping[tuple[str, str], Mapping[str, float]]  # case, method -> measure -> figure


def figures(paper: str) -> Figures:
    """The figures of a paper, by case and method."""
    with (Path(__file__).parent / paper / "reference.csv").open(newline="") as file:
        return {
            (row.pop("case"), row.pop("method")): {key: float(text) for key, text in row.items() if text}
            for row in csv.DictReader(file)
        }
