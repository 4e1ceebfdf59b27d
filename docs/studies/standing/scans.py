"""Scans of one radar, real and simulated, in one form: range, azimuth and range rate of its detections.

The real ones are 110 frames of a 4-D radar at 10 Hz, the sample recordings that come with F. Ding et al. (2022),
"Self-Supervised Scene Flow Estimation With 4-D Automotive Radar", IEEE RA-L 7(3); MIT licence; the data stay outside
this project. Their y points to the left and is mirrored into ours.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.radar import Radar
from sensors.scene import Scene
from testbed.files import read_arrays
from testbed.replay.recording import record
from trackers.geometry import rotation

POINTS, FRAMES = "run_sample_x_y_z_vr_rcs_power", "run_sample_interval_pose"
SCENARIOS = ("cut-in", "dense-traffic", "truck-convoy", "s-curve", "merge", "exit")  # roads with guard rails
SEED, DURATION, EVERY = 700, 6.0, 5  # [s] of each; every fifth frame, as neighbours differ little


class RadarScan(NamedTuple):
    """M detections of one radar at one instant, in its own frame."""

    run: str  # the drive that it is of
    polar: NDArray  # (M, 3) range [m], azimuth [rad], range rate [m/s]
    velocity: NDArray | None = None  # (2,) [m/s] of the radar, where it is known

    @property
    def xy(self) -> NDArray:
        """Places (M, 2) [m], x ahead, y to the right."""
        r, a = self.polar[:, 0], self.polar[:, 1]
        return r[:, None] * np.stack([np.cos(a), np.sin(a)], -1)


def read_real(folder: Path) -> tuple[list[RadarScan], int]:
    """The real scans, each once, and the number of frames, of which some repeat the scan before them, moved.

    Raises ValueError, in one sentence, where there are none to be read.
    """
    file = folder / "frames.npz"
    try:
        arrays = read_arrays(file, (POINTS, FRAMES))
    except ValueError as error:
        raise ValueError(
            f"data: {file} has no frames of a real radar: {error}; give the folder that has them"
        ) from None
    points, frames = arrays[POINTS].astype(float), arrays[FRAMES].astype(float)
    if points.ndim != 2 or points.shape[1] < 8 or frames.ndim != 2 or not np.isfinite(points).all():
        raise ValueError(f"data: {file} has arrays {points.shape}, {frames.shape}; is it the right file?")
    scans: list[RadarScan] = []
    last = np.zeros((0, 3))
    for run, sample in frames[:, :2]:
        rows = points[(points[:, 0] == run) & (points[:, 1] == sample), 2:]
        if not np.array_equal(rows[:, 3:6], last):  # rate, cross section and power of a repeated scan are the same
            scans.append(RadarScan(f"run {run:.0f}", polar_of(rows)))
        last = rows[:, 3:6]
    return scans, len(frames)


def polar_of(rows: NDArray) -> NDArray:
    """Slant range [m], azimuth [rad], range rate [m/s] (M, 3) of rows x, y to the left, z [m], range rate [m/s]."""
    x, y, z, rate = rows[:, :4].T
    return np.stack([np.sqrt(x * x + y * y + z * z), np.arctan2(-y, x), rate], -1)


def drives(scenarios: Sequence[str] = SCENARIOS, duration: float = DURATION) -> Iterator[tuple[str, list[Scene]]]:
    """Scenes of every fifth frame of one drive in each scenario."""
    for name in scenarios:
        yield name, [frame.scene for frame in record(name, SEED, "ideal", duration).frames[::EVERY]]


def at_speed(scene: Scene, speed: float) -> Scene:
    """The scene with all velocities and yaw rates scaled so that the ego drives at `speed` [m/s]."""
    factor = speed / max(float(np.hypot(*scene.ego.velocity)), 1e-9)
    ego, objects, bodies = scene.ego, scene.objects, scene.bodies
    return scene._replace(
        ego=ego._replace(velocity=ego.velocity * factor, yaw_rate=ego.yaw_rate * factor),
        objects=objects._replace(velocity=objects.velocity * factor, yaw_rate=objects.yaw_rate * factor),
        bodies=bodies._replace(velocity=bodies.velocity * factor, yaw_rate=bodies.yaw_rate * factor),
    )


def simulate(radar: Radar, scenes: Sequence[tuple[str, Scene]], seed: int = SEED) -> list[RadarScan]:
    """What the first radar of a rig detects in scenes (name, scene)."""
    alone = replace(radar, sensors=radar.sensors[:1])
    rng = np.random.default_rng(seed)
    found = []
    for name, scene in scenes:
        scan, platform = alone.scan(scene, rng)[0], scene.ego.platform
        model = alone.models[0]
        velocity = model.velocity(platform) @ rotation(model.poses(platform)[2])
        found.append(RadarScan(name, scan.polar, velocity))
    return found
