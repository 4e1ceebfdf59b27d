"""A table of a recording from its file, Parquet or CSV, or one sentence that names file, column and row.

Numbers of a CSV are read to the last digit, so that both formats hold the same.
"""

import csv
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from scenarios.traffic.layouts import other_separator
from testbed.replay.columns import TABLES, Column, Table, like
from testbed.replay.fixes import Fix, repair
from testbed.replay.loaded import Loaded

PARQUET, CSV = ".parquet", ".csv"
SUFFIXES = (PARQUET, CSV)
FORMATS = tuple(suffix[1:] for suffix in SUFFIXES)
ALIKE = 0.8  # similarity from which a column that is not known counts as misspelt
UNLIMITED = ("profile_inside_depth",)  # columns that may be infinite


def path_of(folder: Path, name: str) -> Path | None:
    """The file of a table, None where there is none; ValueError where it is there in both formats."""
    found = [path for path in (folder / f"{name}{suffix}" for suffix in SUFFIXES) if path.is_file()]
    if len(found) > 1:
        raise ValueError(f"{folder} has {found[0].name} and {found[1].name}; keep one of them")
    return found[0] if found else None


def read_table(folder: Path, table: Table, fixes: Sequence[Fix] = ()) -> Loaded | None:
    """A table of a folder, repaired and checked; None where one that is not needed has no file.

    Raises:
        ValueError: there is no such file, it cannot be read, or a column or value is missing or wrong.
    """
    path = path_of(folder, table.name)
    if path is None:
        if table.needed:
            needed = ", ".join(name for name, other in TABLES.items() if other.needed)
            raise ValueError(
                f"{folder} has no {table.name}.parquet or {table.name}.csv; a recording needs the tables {needed}"
            )
        return None
    fixes = [fix for fix in fixes if fix.table == table.name]
    return read_file(path, table, {fix.what: fix.how for fix in fixes if fix.renames}, fixes)


def read_file(path: Path, table: Table, names: Mapping[str, str], fixes: Sequence[Fix] = ()) -> Loaded:
    """The table in a file, some of its columns renamed, repaired and checked; ValueError as in `read_table`."""
    try:
        content = _read_csv(path) if path.suffix == CSV else pq.read_table(path)
    except (pa.ArrowException, OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path.name} cannot be read: {_first_line(error)}; write it again") from None
    content = content.rename_columns([names.get(name, name) for name in content.column_names])
    _check_names(path.name, content.column_names, table)
    found = {
        c.name: _values(path.name, c, content.column(c.name)) for c in table.columns if c.name in content.schema.names
    }
    unread = tuple(name for name in content.column_names if name not in table.names)
    loaded = repair(Loaded(path.name, found, content.num_rows, unread), [fix for fix in fixes if not fix.renames])
    for column in table.columns:
        if column.name in loaded and not column.text:
            _check_numbers(loaded, column)
    return loaded


def _read_csv(path: Path) -> pa.Table:
    """All columns as texts; an empty cell is null."""
    with open(path, newline="", encoding="utf-8-sig") as file:
        head = next(csv.reader(file), [])
    if not head:
        raise csv.Error("it is empty")
    names = [name.strip() for name in head]
    if other := other_separator(names):
        raise csv.Error(f"its columns are separated by {other!r}, not by commas")
    return pa_csv.read_csv(
        path,
        read_options=pa_csv.ReadOptions(column_names=names, skip_rows=1),
        convert_options=pa_csv.ConvertOptions(
            column_types=dict.fromkeys(names, pa.string()), null_values=[""], strings_can_be_null=True
        ),
    )


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")[:200]


def _check_names(file: str, names: list[str], table: Table) -> None:
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"{file} has the column {twice[0]} twice; keep one of them")
    absent = [name for name in table.names if name not in names]
    for name in names:
        close = get_close_matches(name.lower(), absent, 1, ALIKE) if name not in table.names else []
        if close:
            option = table.option and f", or {table.option.format(column=close[0], name=name)}"
            raise ValueError(f"{file} has a column {name}; did you mean {close[0]}? Rename it{option}")
    for column in table.columns:
        if column.needed and column.name not in names:
            other = [name for name in names if name not in table.names and like(name, table) == column.name]
            option = table.option and f"{table.option.format(column=column.name, name=(other or ['NAME'])[0])}; "
            raise ValueError(
                f"{file} has no column {column.name}, {column.note}{f' [{column.unit}]' * bool(column.unit)}; "
                f"{f'rename {other[0]}, or ' if other else ''}{option}it has {', '.join(names)}"
            )


def _values(file: str, column: Column, values: pa.ChunkedArray) -> NDArray:
    """The values as numbers (N,), or as texts where the column holds such."""
    values = values.combine_chunks() if values.num_chunks != 1 else values.chunk(0)
    if pa.types.is_dictionary(values.type):
        values = values.dictionary_decode()
    if column.text:
        try:
            texts = pc.fill_null(pc.utf8_trim_whitespace(pc.cast(values, pa.string())), "")
        except pa.ArrowException:
            raise ValueError(f"{file}, column {column.name}: texts are due, got {values.type}; convert them") from None
        return np.array(texts.to_pylist(), np.str_).reshape(-1)
    if pa.types.is_string(values.type) or pa.types.is_large_string(values.type):
        values = pc.utf8_trim_whitespace(values)
        values = pc.if_else(pc.equal(values, ""), pa.scalar(None, values.type), values)
        try:
            numbers = pc.cast(values, pa.float64())
        except pa.ArrowInvalid:
            row = _first_text(values)
            raise ValueError(
                f"{file}, column {column.name}, row {row + 1}: a number is due, got {values[row].as_py()!r}; "
                "write it with a decimal point, and leave the cell empty where there is none"
            ) from None
    else:
        try:
            numbers = pc.cast(values, pa.float64(), safe=False)
        except pa.ArrowException:
            raise ValueError(f"{file}, column {column.name}: numbers are due, got {values.type}; convert it") from None
    return numbers.fill_null(np.nan).to_numpy(zero_copy_only=False)


def _first_text(values: pa.Array) -> int:
    """Row of the first text that is no number; there is one."""
    low, high = 0, len(values)
    while high - low > 1:
        middle = (low + high) // 2
        try:
            pc.cast(values[low:middle], pa.float64())
            low = middle
        except pa.ArrowInvalid:
            high = middle
    return low


def _check_numbers(table: Loaded, column: Column) -> None:
    value, name = table[column.name], column.name
    if column.needed:
        table.check(name, np.isnan(value), lambda row: "a number is due, got none", "give one, or leave the row out")
    if name not in UNLIMITED:
        table.check(name, np.isinf(value), lambda row: f"got {value[row]}", "give a finite number, or an empty cell")
    outside = (value < column.least) | (value > column.most)
    limits = f"{column.least:.6g} to {column.most:.6g}"
    table.check(
        name,
        outside,
        lambda row: f"must be within {limits} {column.unit}".rstrip() + f", got {value[row]:g}",
        column.remedy,
    )
