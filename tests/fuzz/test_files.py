"""Damaged files wherever one is read: a result, or one sentence and exit status 2, in bounded time and memory.

`python -m tests.fuzz.test_files 100` tries so many damaged copies of each file and counts how the calls ended.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from tests.fuzz.calls import Call, outcomes
from tests.fuzz.damage import NESTED, claim, with_array
from tests.fuzz.declared import line
from tests.fuzz.made import make
from tests.fuzz.readers import READERS, calls

REAL = ("columns", "objects", "points", "offsets", "classes")  # arrays of the real extract
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


def test_what_is_nested_flat_or_claims_to_be_huge_is_refused(template, tmp_path):
    points, real = (template / name for name in ("points.npz", "real/objects.npz"))
    rng = np.random.default_rng(0)
    u = with_array(points.read_bytes(), "u", np.array(0.5))
    damaged = (
        (line("regress"), "baselines.json", b"[" * NESTED),
        (line("compare", out="done"), "done/study.json", b'{"a":' * NESTED),
        (line("learn-htg"), "points.npz", u),
        (line("learn-spline"), "points.npz", u),
        (line("learn-htg"), "points.npz", claim(points.read_bytes(), rng)),
        *((line("calibrate"), "real/objects.npz", with_array(real.read_bytes(), name, np.array(1))) for name in REAL),
    )
    wanted = [Call(args, ((file, content),), seconds=10.0) for args, file, content in damaged]
    ended = outcomes(wanted, template, tmp_path / "scratch")
    assert [(str(found.call), found.fault) for found in ended if found.fault or found.status != 2] == []


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
