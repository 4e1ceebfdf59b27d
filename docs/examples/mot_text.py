"""Tracks and truth as MOTChallenge text, for evaluators that read it, and such text as tracks for `testbed score`.

    python mot_text.py out TRACKS.csv RECORDING FOLDER      writes FOLDER/gt.txt and FOLDER/tracks.txt
    python mot_text.py in TRACKS.txt RECORDING TRACKS.csv

RECORDING is a folder of CSV tables. A frame is a scan, counted from 1. A box is the rectangle around that of the track
[m], along the axes of the frame of `ego`, which loses the heading: coming in, heading and velocity are those of the way
of the centre, and the longer side is the length.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

BOX = ["frame", "id", "left", "top", "width", "height", "score"]


def scan_times(recording: Path) -> np.ndarray:
    """Times (F,) [s] of all scans."""
    files = (recording / f"{name}.csv" for name in ("detections", "scans"))
    return np.unique(np.concatenate([pd.read_csv(file)["time"] for file in files if file.exists()]))


def boxes(table: pd.DataFrame, times: np.ndarray) -> pd.DataFrame:
    """Rectangles of the rows that are at a scan."""
    frame = np.abs(table["time"].to_numpy()[:, None] - times).argmin(1)
    table = table.assign(frame=frame + 1)[np.abs(table["time"] - times[frame]) < 0.01]
    c, s = np.abs(np.cos(table["heading"])), np.abs(np.sin(table["heading"]))
    wide, high = c * table["length"] + s * table["width"], s * table["length"] + c * table["width"]
    left, top = table["x"] - wide / 2, table["y"] - high / 2
    numbers = pd.factorize(table["id"])[0] + 1
    return pd.DataFrame(dict(zip(BOX, (table["frame"], numbers, left, top, wide, high, 1.0), strict=True)))


def write_text(table: pd.DataFrame, recording: Path, folder: Path) -> None:
    """Tracks with the centre in the world behind the box; of the truth, class 1 and whether it counts."""
    times = scan_times(recording)
    folder.mkdir(parents=True, exist_ok=True)
    rows = boxes(table, times).assign(x=table["x"], y=table["y"], z=0.0)
    rows.sort_values(["frame", "id"]).to_csv(folder / "tracks.txt", header=False, index=False)
    truth = pd.read_csv(recording / "truth.csv")
    rows = boxes(truth, times).assign(kind=1, visible=truth.get("visible", 1.0))
    if "expected" in truth:
        rows["score"] = (truth["expected"] > 0.5).astype(int)
    rows.sort_values(["frame", "id"]).to_csv(folder / "gt.txt", header=False, index=False)


def read_text(file: Path, recording: Path) -> pd.DataFrame:
    """Tracks in the columns of `testbed score`; one of a single frame has no velocity and is left out."""
    rows = pd.read_csv(file, header=None).iloc[:, :7].set_axis(BOX, axis=1).sort_values(["id", "frame"])
    rows = rows[rows.groupby("id")["frame"].transform("size") > 1]
    rows["time"] = scan_times(recording)[rows["frame"].to_numpy() - 1]
    rows["x"], rows["y"] = rows["left"] + rows["width"] / 2, rows["top"] + rows["height"] / 2
    for one, velocity in (("x", "vx"), ("y", "vy")):
        ways = [np.gradient(own[one], own["time"]) for _, own in rows.groupby("id")]
        rows[velocity] = np.concatenate([np.zeros(0), *ways])
    sides = np.sort(rows[["width", "height"]].to_numpy(), 1)
    rows = rows.assign(heading=np.arctan2(rows["vy"], rows["vx"]), width=sides[:, 0], length=sides[:, 1])
    return rows.sort_values(["time", "id"])[["time", "id", "x", "y", "heading", "vx", "vy", "length", "width"]]


if __name__ == "__main__":
    way, tracks, recording, out = sys.argv[1], *map(Path, sys.argv[2:5])
    if way == "out":
        write_text(pd.read_csv(tracks), recording, out)
    else:
        read_text(tracks, recording).to_csv(out, index=False)
    print(f"written: {out}")
