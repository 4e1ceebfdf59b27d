"""Damaged files at every door that reads one: a result, or one sentence and exit status 2, in bounded time and memory.

`python -m tests.fuzz.test_files 100` tries so many damaged copies of each file and counts how the calls ended.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.fuzz.calls import outcomes
from tests.fuzz.made import make
from tests.fuzz.readers import READERS, calls

QUICK, MANY = 2, 60  # damaged copies of a file


def faults(reader, template, scratch, seeds):
    file, args = reader
    ended = outcomes(calls(template, file, args, seeds), template, scratch)
    return [f"{file}, seed {seed}, {found.call}: {found.fault}" for seed, found in zip(seeds, ended) if found.fault]


def test_a_few_damaged_copies_of_every_file(template, tmp_path):
    found = []
    for reader in READERS:
        if not reader[0].endswith(".rrd"):  # each of those is read in a process of its own: slow
            found += faults(reader, template, tmp_path / "scratch", range(QUICK))
    assert found == []


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS, ids=lambda r: f"{r[1][0]}-{r[0]}")
def test_many_damaged_copies(reader, template, tmp_path):
    assert faults(reader, template, tmp_path / "scratch", range(100, 100 + MANY)) == []


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        base = make(Path(folder) / "template")
        tried = wrong = 0
        for reader in READERS:
            seeds = range(1000, 1000 + int(sys.argv[1]))
            found = faults(reader, base, Path(folder) / "scratch", seeds)
            print(f"{reader[1][0]} of {reader[0]}: {len(seeds)} copies, {len(found)} wrong", flush=True)
            for text in found[:5]:
                print("   " + text, flush=True)
            tried, wrong = tried + len(seeds), wrong + len(found)
        print(f"all: {tried} copies, {wrong} wrong")
