"""The small files that the project makes, for calls that read them."""

import shutil
from pathlib import Path

import numpy as np

from testbed.experiments.command import execute
from testbed.experiments.compare import Comparison, Settings, write_runs
from testbed.experiments.engine import Engine
from testbed.experiments.regress import COMMITTED
from testbed.experiments.single import RunConfig, run
from testbed.experiments.store import Results
from testbed.replay.recording import record
from testbed.replay.writing import write

TRACKS = "time,id,x,y,heading,vx,vy,length,width\n0,a,330,0,0,25,0,4.5,1.8\n0.2,a,335,0,0,25,0,4.5,1.8\n"


def make(folder: Path) -> Path:
    """A folder with a log, detections, baselines, and what is no file of ours."""
    folder.mkdir(parents=True)
    made = run(RunConfig("cut-in", ("rm-feldmann",), "front", "idle", 0, 0.2, str(folder / "runs"), "full"))
    assert made.rrd is not None
    made.rrd.replace(folder / "log.rrd")
    shutil.rmtree(folder / "runs")
    shutil.copy(COMMITTED, folder / "baselines.json")
    np.savez(folder / "points.npz", **points(400))
    done = Comparison(("cut-in",), ("rm-feldmann",), (0,), Settings("front", duration=0.2), out=str(folder / "done"))
    execute(done, Engine())
    write_runs(Results.read(done))
    write(record("cut-in", 0, "front", 0.2), folder / "drive", "csv")
    (folder / "tracks.csv").write_text(TRACKS)
    (folder / "real").mkdir()
    np.savez(folder / "real" / "objects.npz", **extract(40, 10))
    for name in ("folder", "folder.json", "folder.rrd", "folder.npz", "folder.png", "folder.parquet"):
        (folder / name).mkdir()
    for name in ("EMPTY", "empty.npz", "empty.rrd"):
        (folder / name).touch()
    (folder / "FILE").write_text("neither a log nor a table\n")
    (folder / "circle").symlink_to("circle")
    (folder / "dangling").symlink_to("nowhere")
    return folder


def points(n: int) -> dict[str, np.ndarray]:
    """Detections in the layout of docs/learning.md."""
    rng = np.random.default_rng(0)
    return {"u": rng.uniform(-1, 1, (n, 2)), "aspect": rng.uniform(-np.pi, np.pi, n)}


def extract(cars: int, each: int) -> dict[str, np.ndarray]:
    """Boxes of cars and their detections in the layout of the real extract."""
    rng = np.random.default_rng(0)
    x = rng.uniform(10, 60, cars)
    columns = ("frame", "class", "cx", "cy", "yaw", "length", "width", "height")
    objects = np.stack([np.arange(cars), 0 * x, x, 0 * x, 0 * x, 0 * x + 4.5, 0 * x + 1.8, 0 * x + 1.5], -1)
    on = np.repeat(objects[:, 2:4], each, 0) + rng.uniform(-0.9, 0.9, (cars * each, 2)) * [2.25, 0.9]
    return {
        "columns": np.array(columns), "objects": objects, "classes": np.array(["Car", "Truck", "Bus"]),
        "points": np.column_stack([on, 0 * on[:, 0]]), "offsets": np.arange(cars + 1) * each,
    }  # fmt: skip
