"""The columns of one table of a recording, and errors that name file, column and row."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Loaded:
    """The columns of a table that are in its file; numbers that are not given are NaN, texts empty."""

    file: str  # its name
    columns: Mapping[str, NDArray]  # (N,) each
    rows: int  # N
    unread: tuple[str, ...] = ()  # names of further columns in the file

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> NDArray:
        return self.columns[name]

    def texts(self, name: str) -> NDArray:
        """A column of texts (N,), empty where nothing is given."""
        return self.columns[name] if name in self.columns else np.full(self.rows, "", np.str_)

    def numbers(self, name: str, default: float) -> NDArray:
        """A column of numbers (N,), with the default where nothing is given."""
        if name not in self.columns:
            return np.full(self.rows, default)
        return np.where(np.isnan(self.columns[name]), default, self.columns[name])

    def fault(self, name: str, row: int, what: str, remedy: str) -> ValueError:
        """The error about a row, counted from 0 here and from 1 below the header for people."""
        return ValueError(f"{self.file}, column {name}, row {row + 1}: {what}; {remedy}")

    def check(self, name: str, wrong: NDArray, what: Callable[[int], str], remedy: str) -> None:
        """Raise the error about the first row of the mask (N,), if any."""
        if wrong.any():
            row = int(wrong.argmax())
            raise self.fault(name, row, what(row), remedy)

    def check_sorted(self, once: bool = False) -> None:
        """Raise the error about the first row whose time is before that of the row above, or, if `once`, the same."""
        time = self["time"]
        step = np.diff(time, prepend=-np.inf)
        remedy = "sort the rows by time, and keep one of each" if once else "sort the rows by time"
        wrong = step <= 0 if once else step < 0
        self.check("time", wrong, lambda row: f"{time[row]} s comes after {time[row - 1]} s", remedy)
