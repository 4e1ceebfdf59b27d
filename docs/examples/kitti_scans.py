"""A drive in the layout of KITTI raw, as tables for `testbed replay`: contours seen by a lidar, without range rates.

    python docs/examples/kitti_scans.py DRIVE OUT
    testbed replay OUT --tracker imm-spline

DRIVE has oxts/ and velodyne_points/, each with timestamps.txt and data/. Of a scan the nearest return in each direction
is kept, between ground and roofs: the outlines of all that stands or drives. y points to the left, as there.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

HEIGHTS = (-1.2, -0.2)  # [m] of the returns that are kept, from the lidar, which is 1.73 m above the ground
STEP, REACH = np.radians(0.4), 60.0  # [rad] between directions, [m]
LIDAR = {
    "name": "lidar", "x": 0.81, "y": -0.32, "yaw": 0.0, "max_range": REACH, "fov": 2 * np.pi, "rate": 10.0,
    "sigma_range": 0.03, "sigma_azimuth": STEP / 2, "count_at_15m": 3.0 / 15.0 / STEP, "count_falloff": 1.0,
    "count_max": 200.0, "clutter": 0.5,
}  # fmt: skip
EARTH = 6378137.0  # [m] radius


def times(folder: Path) -> np.ndarray:
    """Times (N,) [s] of the files of a sensor, since midnight of the first day."""
    stamps = np.array((folder / "timestamps.txt").read_text().split("\n"), "datetime64[ns]")
    stamps = stamps[~np.isnat(stamps)]
    return (stamps - stamps[0].astype("datetime64[D]")).astype(np.int64) / 1e9


def ego(folder: Path) -> pd.DataFrame:
    """Place by a Mercator map around the first point; heading 0 is east, from there to the north."""
    rows = np.array([np.loadtxt(file) for file in sorted((folder / "data").glob("*.txt"))])
    latitude, longitude = np.radians(rows[:, 0]), np.radians(rows[:, 1])
    x = EARTH * np.cos(latitude[0]) * longitude
    y = EARTH * np.cos(latitude[0]) * np.log(np.tan(np.pi / 4 + latitude / 2))
    motion = {"heading": rows[:, 5], "speed": rows[:, 8], "yaw_rate": rows[:, 22]}
    return pd.DataFrame({"time": times(folder), "x": x - x[0], "y": y - y[0], **motion})


def outline(points: np.ndarray) -> pd.DataFrame:
    """The nearest return (x, y, z, reflectance) of each direction, between the heights."""
    x, y, z, _ = points.T
    r, azimuth = np.hypot(x, y), np.arctan2(y, x)
    kept = (HEIGHTS[0] < z) & (z < HEIGHTS[1]) & (r < REACH)
    scan = pd.DataFrame({"range": r, "azimuth": azimuth, "bin": np.floor(azimuth / STEP)})[kept]
    return scan.sort_values("range").groupby("bin").head(1).drop(columns="bin")


def convert(drive: Path, out: Path) -> None:
    """Write the tables of a drive."""
    out.mkdir(parents=True, exist_ok=True)
    lidar = drive / "velodyne_points"
    files = sorted((lidar / "data").glob("*.bin"))
    scans = [outline(np.fromfile(file, np.float32).reshape(-1, 4).astype(float)) for file in files]
    stamped = [scan.assign(time=time, sensor="lidar") for scan, time in zip(scans, times(lidar), strict=True)]
    pd.concat(stamped).to_csv(out / "detections.csv", index=False)
    ego(drive / "oxts").to_csv(out / "ego.csv", index=False)
    pd.DataFrame([LIDAR]).to_csv(out / "sensors.csv", index=False)
    print(f"{len(scans)} scans, {sum(map(len, scans)) / len(scans):.0f} points a scan, in {out}")


if __name__ == "__main__":
    convert(Path(sys.argv[1]), Path(sys.argv[2]))
