"""Calls of the commands that read a file, with damaged ones in its place."""

from pathlib import Path
from typing import Any

from tests.fuzz.calls import ENOUGH, Call
from tests.fuzz.damage import damaged
from tests.fuzz.declared import line

SLOW = 15.0  # [s] for a command that reads a log, in a process of its own
RUN = "cut-in_rm-feldmann_front_seed0"
RESUME = line("compare", out="done")
READERS: tuple[tuple[str, tuple[str, ...]], ...] = (  # file, and a command that reads it
    ("log.rrd", line("review")),
    ("log.rrd", line("diff")),
    ("log.rrd", line("learn-htg", data="log.rrd")),
    ("log.rrd", line("learn-spline", data="log.rrd")),
    ("points.npz", line("learn-htg")),
    ("points.npz", line("learn-spline")),
    ("real/objects.npz", line("learn-htg", data="real")),
    ("real/objects.npz", line("calibrate")),
    ("baselines.json", line("regress")),
    ("baselines.json", (*line("regress")[:-1], "--update")),
    ("done/study.json", RESUME),
    ("done/runs.parquet", RESUME),
    (f"done/rows/{RUN}.parquet", RESUME),
    ("done/recordings/cut-in_front_seed0.npz", line("compare", out="done", tracker="rm-koch")),
    *((f"drive/{table}.csv", line("replay")) for table in ("detections", "scans", "ego", "lanes")),
    ("drive/sensors.csv", line("check", what="recording", name="drive")),
    ("drive/truth.csv", line("score")),
    ("tracks.csv", line("score")),
)


def calls(template: Path, file: str, args: tuple[str, ...], seeds: Any) -> list[Call]:
    """The command on damaged copies of the file."""
    seconds = SLOW if file.endswith(".rrd") else ENOUGH
    return [Call(args, ((file, damaged(template / file, seed)),), seconds=seconds) for seed in seeds]
