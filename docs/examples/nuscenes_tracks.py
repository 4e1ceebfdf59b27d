"""Tracks and detections as JSON in the style of nuScenes, and such JSON as tables.

    python nuscenes_tracks.py out TRACKS.csv RECORDING FILE.json
    python nuscenes_tracks.py in FILE.json FOLDER [SAMPLE.json]     writes FOLDER/tracks.csv, FOLDER/detections.csv

`results` is the format of a submission to its tracking challenge, by sample token: `translation`, `size` (width,
length, height), `rotation` (w, x, y, z), `velocity`, `tracking_id`, `tracking_score`. `detections` has the scan in
the fields of its radars, in the frame of the sensor: `channel`, `x`, `y`, and the radial velocity as `vx`, `vy`. Going
out a token is the time in microseconds; coming in, SAMPLE.json of nuScenes has the times of others. The frame stays.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd

META = {f"use_{what}": what == "radar" for what in ("camera", "lidar", "radar", "map", "external")}
HEIGHT, NAME = 1.6, "car"  # of what the tables do not say


def tokens(times: pd.Series) -> pd.Series:
    """Of the samples at some times [s]."""
    return (times * 1e6).round().astype("int64").astype(str)


def tracked(row: pd.Series) -> dict:
    """One track of a sample."""
    kind = row.get("class")
    return {
        "sample_token": row["token"],
        "translation": [row["x"], row["y"], HEIGHT / 2],
        "size": [row["width"], row["length"], HEIGHT],
        "rotation": [np.cos(row["heading"] / 2), 0.0, 0.0, np.sin(row["heading"] / 2)],
        "velocity": [row["vx"], row["vy"]],
        "tracking_id": str(row["id"]),
        "tracking_name": kind if isinstance(kind, str) else NAME,
        "tracking_score": float(row.get("existence", 1.0)),
    }


def detected(row: pd.Series) -> dict:
    """One detection of a sample."""
    c, s = np.cos(row["azimuth"]), np.sin(row["azimuth"])
    rate = row["range_rate"]
    return {"channel": row["sensor"], "x": row["range"] * c, "y": row["range"] * s, "vx": rate * c, "vy": rate * s}


def by_token(table: pd.DataFrame, make: object) -> dict[str, list[dict]]:
    """Token -> what is made of each of its rows."""
    table = table.assign(token=tokens(table["time"]))
    return {token: [make(row) for _, row in rows.iterrows()] for token, rows in table.groupby("token")}


def write_json(tracks: Path, recording: Path, out: Path) -> None:
    """Both tables as one file."""
    results = by_token(pd.read_csv(tracks), tracked)
    detections = by_token(pd.read_csv(recording / "detections.csv"), detected)
    samples = dict.fromkeys([*detections, *results])
    results = {token: results.get(token, []) for token in samples}  # a submission has all samples
    out.write_text(json.dumps({"meta": META, "results": results, "detections": detections}, default=float))


def read_json(file: Path, folder: Path, samples: Path | None) -> None:
    """Both tables of a file, as far as it has them."""
    found = json.loads(file.read_text())
    known = {s["token"]: s["timestamp"] for s in json.loads(samples.read_text())} if samples else {}
    folder.mkdir(parents=True, exist_ok=True)
    rows = [
        (known.get(token, token), one["tracking_id"], *one["translation"][:2],
         2 * np.arctan2(one["rotation"][3], one["rotation"][0]), *one["velocity"], one["size"][1], one["size"][0],
         one["tracking_score"], one["tracking_name"])
        for token, ones in found["results"].items() for one in ones
    ]  # fmt: skip
    names = ["time", "id", "x", "y", "heading", "vx", "vy", "length", "width", "existence", "class"]
    save(pd.DataFrame(rows, columns=names), folder / "tracks.csv")
    rows = [
        (known.get(token, token), one["channel"], np.hypot(one["x"], one["y"]), (a := np.arctan2(one["y"], one["x"])),
         one["vx"] * np.cos(a) + one["vy"] * np.sin(a))
        for token, ones in found.get("detections", {}).items() for one in ones
    ]  # fmt: skip
    save(pd.DataFrame(rows, columns=["time", "sensor", "range", "azimuth", "range_rate"]), folder / "detections.csv")


def save(table: pd.DataFrame, file: Path) -> None:
    """Write a table with times in seconds, sorted by them."""
    table.assign(time=table["time"].astype("int64") / 1e6).sort_values("time", kind="stable").to_csv(file, index=False)


if __name__ == "__main__":
    way, first, second, *third = sys.argv[1], *map(Path, sys.argv[2:])
    if way == "out":
        write_json(first, second, third[0])
    else:
        read_json(first, second, third[0] if third else None)
    print(f"written: {third[0] if way == 'out' else second}")
