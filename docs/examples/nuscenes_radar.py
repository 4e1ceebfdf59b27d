"""A scene in the layout of nuScenes, as tables for `testbed replay`: five radars, the ego, annotated vehicles.

    python docs/examples/nuscenes_radar.py DATASET SCENE OUT
    testbed replay OUT --tracker imm-htg

DATASET has the JSON tables in v1.0-mini/ (or the first v1.0-* there is) and the sweeps as .pcd. The annotations are at
2 Hz; `testbed replay` interpolates them. y points to the left, as there.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd

SHEET = {"max_range": 100.0, "fov": 2.1, "sigma_range": 0.2, "sigma_azimuth": 0.017, "sigma_rate": 0.1, "rate": 13.0}
TYPES = {"F": "f", "I": "i", "U": "u"}
CLASSES = {"vehicle.car": "car", "vehicle.truck": "truck", "vehicle.bus": "bus", "vehicle.motorcycle": "motorcycle"}


def table(dataset: Path, name: str) -> pd.DataFrame:
    """One of the JSON tables, by token."""
    folder = min(dataset.glob("v1.0-*"))
    return pd.DataFrame(json.loads((folder / f"{name}.json").read_text())).set_index("token")


def of(rows: pd.DataFrame, other: pd.DataFrame, column: str) -> pd.DataFrame:
    """The rows with what another table has of the token in a column."""
    return rows.merge(other, "left", left_on=column, right_index=True, suffixes=("", "_of"))


def yaw(rotation: pd.Series) -> np.ndarray:
    """Headings (N,) [rad] of quaternions w, x, y, z."""
    w, x, y, z = np.array(rotation.tolist()).T
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))


def motion(time: np.ndarray, x: np.ndarray, y: np.ndarray, heading: np.ndarray) -> dict[str, np.ndarray]:
    """Velocity [m/s] and yaw rate [rad/s] (N,) by differences, 0 of what is seen once."""
    if len(time) < 2:
        return dict.fromkeys(("vx", "vy", "yaw_rate"), np.zeros(len(time)))
    return dict(zip(("vx", "vy", "yaw_rate"), np.gradient([x, y, np.unwrap(heading)], time, axis=1), strict=True))


def sweep(file: Path) -> pd.DataFrame:
    """Range [m], azimuth [rad] and range rate [m/s] of a radar's sweep."""
    head, _, body = file.read_bytes().partition(b"DATA binary\n")
    said = {line.split()[0]: line.split()[1:] for line in head.decode().splitlines()}
    kinds = [TYPES[kind] + size for kind, size in zip(said["TYPE"], said["SIZE"], strict=True)]
    p = np.frombuffer(body, list(zip(said["FIELDS"], kinds, strict=True)), int(said["POINTS"][0]))
    x, y, vx, vy = (p[name].astype(float) for name in ("x", "y", "vx", "vy"))
    r = np.hypot(x, y)
    return pd.DataFrame({"range": r, "azimuth": np.arctan2(y, x), "range_rate": (x * vx + y * vy) / r})


def truth(dataset: Path, samples: pd.DataFrame) -> pd.DataFrame:
    """The vehicles of the samples, sorted by time."""
    known = of(table(dataset, "sample_annotation"), table(dataset, "instance"), "instance_token")
    known = known[known.sample_token.isin(samples.index)].join(table(dataset, "category").name, on="category_token")
    known = known[known.name.str.startswith("vehicle.")]
    place, size = (np.array(known[column].tolist()).reshape(-1, 3) for column in ("translation", "size"))
    rows = pd.DataFrame({
        "time": samples.timestamp.loc[known.sample_token].to_numpy() / 1e6, "id": known.instance_token.to_numpy(),
        "x": place[:, 0], "y": place[:, 1], "heading": yaw(known.rotation), "length": size[:, 1], "width": size[:, 0],
        "class": [CLASSES.get(".".join(name.split(".")[:2]), "van") for name in known.name],
    }).sort_values("time")  # fmt: skip
    courses = [one.assign(**motion(*one[["time", "x", "y", "heading"]].to_numpy().T)) for _, one in rows.groupby("id")]
    return pd.concat(courses).sort_values("time", kind="stable")


def convert(dataset: Path, scene: str, out: Path) -> None:
    """Write the tables of a scene."""
    out.mkdir(parents=True, exist_ok=True)
    scenes, samples = table(dataset, "scene"), table(dataset, "sample")
    samples = samples[samples.scene_token == scenes.index[scenes.name == scene][0]]
    mounts = table(dataset, "calibrated_sensor").join(table(dataset, "sensor"), on="sensor_token")
    data = of(table(dataset, "sample_data"), mounts[mounts.modality == "radar"], "calibrated_sensor_token")
    data = data[data.sample_token.isin(samples.index) & data.channel.notna()].sort_values("timestamp")
    scans = [
        sweep(dataset / row.filename).assign(time=row.timestamp / 1e6, sensor=row.channel) for row in data.itertuples()
    ]
    pd.concat(scans).to_csv(out / "detections.csv", index=False)
    data.assign(time=data.timestamp / 1e6).rename(columns={"channel": "sensor"})[["time", "sensor"]].to_csv(
        out / "scans.csv", index=False
    )
    pose = table(dataset, "ego_pose").loc[data.ego_pose_token].drop_duplicates("timestamp").sort_values("timestamp")
    time, place, heading = pose.timestamp.to_numpy() / 1e6, np.array(pose.translation.tolist()), yaw(pose.rotation)
    state = {"time": time, "x": place[:, 0], "y": place[:, 1], "heading": heading}
    pd.DataFrame(state | motion(time, place[:, 0], place[:, 1], heading)).to_csv(out / "ego.csv", index=False)
    used = mounts[mounts.channel.isin(data.channel)].drop_duplicates("channel")
    place = np.array(used.translation.tolist())
    sheets = {"name": used.channel, "x": place[:, 0], "y": place[:, 1], "yaw": yaw(used.rotation)}
    pd.DataFrame(sheets).assign(**SHEET).to_csv(out / "sensors.csv", index=False)
    truth(dataset, samples).to_csv(out / "truth.csv", index=False)
    print(f"{len(data)} sweeps of {len(used)} radars, {len(samples)} annotated samples, in {out}")


if __name__ == "__main__":
    convert(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
