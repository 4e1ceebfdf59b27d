"""An observation of the tracks with their uncertainty: covariances, existence, classes, tentative tracks too.

The columns, one by one: docs/track-observation.md.
"""

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box, Dict, MultiBinary
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from scenarios.bodies import motion
from trackers.geometry import rotation
from trackers.multi.tracks import REPORT_ABOVE, Tracks

CLASSES = ("car", "van", "truck", "bus", "articulated", "tractor", "motorcycle")
UPPER = np.triu_indices(4)  # of a covariance of x, y, vx, vy
MEAN = ("x", "y", "cos_h", "sin_h", "vx", "vy", "yaw_rate", "length", "width")
COVARIANCE = ("xx", "xy", "xvx", "xvy", "yy", "yvx", "yvy", "vxvx", "vxvy", "vyvy")
CERTAINTY = ("heading_std", "yaw_rate_std", "length_std", "width_std", "existence", "age", "reported")
EDGES = ("front_std", "rear_std", "left_std", "right_std")
COLUMNS = MEAN + COVARIANCE + CERTAINTY + EDGES
LARGE = {"x": 100.0, "y": 100.0, "vx": 30.0, "vy": 30.0, "length": 10.0, "width": 3.0, "age": 10.0}  # else 1
SCALE = np.array([LARGE.get(name, 1.0) for name in COLUMNS])
EGO_SCALE = np.array([30.0, 1.0, 3.0])  # speed, yaw rate, lane offset
NONE = -1  # id of a row without a track


class Rows(NamedTuple):
    """The nearest tracks, padded to K rows."""

    tracks: NDArray  # (K, 30) see `COLUMNS`
    class_probability: NDArray  # (K, 7) of `CLASSES`, zeros where the tracker has no classes
    mask: NDArray  # (K,) int8, 1 where there is a track
    id: NDArray  # (K,) int, -1 where there is none


def track_rows(tracks: Tracks, pose: NDArray, velocity: NDArray, size: int, above: float) -> Rows:
    """The tracks of an existence above a probability, in the frame of the ego, by distance; equal distances by age.

    Args:
        tracks: T tracks in the world frame.
        pose: (3,) x, y [m], heading [rad] of the ego.
        velocity: (2,) [m/s] of the ego, world frame.
        size: K; of more tracks the nearest are taken.
        above: existence from which on a track is taken, exclusive.

    Raises:
        ValueError: class probabilities without names, and not of the seven `CLASSES`.
    """
    estimate = tracks.estimate
    offset = estimate.pose[:, :2] - pose[:2]
    taken = np.flatnonzero(tracks.existence > above)
    order = taken[np.argsort((offset[taken] ** 2).sum(-1), kind="stable")][:size]
    n, M = len(order), rotation(pose[2])
    R = np.zeros((4, 4))
    R[:2, :2] = R[2:, 2:] = M.T
    heading = estimate.pose[order, 2] - pose[2]
    table = np.zeros((size, len(COLUMNS)), np.float32)
    table[:n, :2] = offset[order] @ M
    table[:n, 2], table[:n, 3] = np.cos(heading), np.sin(heading)
    table[:n, 4:6] = (estimate.velocity[order] - velocity) @ M
    table[:n, 6], table[:n, 7:9] = estimate.yaw_rate[order], estimate.size[order]
    table[:n, 9:19] = (R @ estimate.cov[order] @ R.T)[:, UPPER[0], UPPER[1]]
    table[:n, 19], table[:n, 20] = estimate.heading_std[order], estimate.yaw_rate_std[order]
    table[:n, 21:23] = estimate.size_std[order]
    table[:n, 23], table[:n, 24] = tracks.existence[order], tracks.age[order]
    table[:n, 25], table[:n, 26:] = tracks.existence[order] > REPORT_ABOVE, estimate.edges[order]
    classes, ids, mask = np.zeros((size, len(CLASSES)), np.float32), np.full(size, NONE), np.zeros(size, np.int8)
    for name, p in _class_probabilities(tracks):
        classes[:n, CLASSES.index(name)] = p[order]
    ids[:n], mask[:n] = tracks.id[order], 1
    return Rows(table, classes, mask, ids)


def _class_probabilities(tracks: Tracks) -> list[tuple[str, NDArray]]:
    """Names of those of `CLASSES` that the tracker knows, and the probabilities (T,) of each."""
    p, names = tracks.estimate.class_probability, tracks.memory.classes or CLASSES
    if p is None:
        return []
    if p.shape[-1] != len(names):
        raise ValueError(
            f"class_probability has {p.shape[-1]} columns for the classes {', '.join(names)}; give "
            "Tracks.memory.classes the names of its columns"
        )
    return [(name, column) for name, column in zip(names, p.T, strict=True) if name in CLASSES]


def observed(
    tracks: Tracks, ego: Vehicle, size: int, existence: float, scale: bool
) -> tuple[dict[str, NDArray], NDArray]:
    """The observation of `TrackObservation`, of tracks for an ego, and the ids (K,) of its rows."""
    velocity, yaw_rate = motion(ego)
    rows = track_rows(tracks, np.array([*ego.position, ego.heading]), velocity, size, existence)
    own, table = np.array([ego.speed, yaw_rate, ego.lane_offset[1]]), rows.tracks
    if scale:
        own, table = own / EGO_SCALE, table / SCALE
    found = {
        "ego": own.astype(np.float32),
        "tracks": table.astype(np.float32),
        "class_probability": rows.class_probability,
        "mask": rows.mask,
    }
    return found, rows.id


class TrackObservation(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """Observe the tracks themselves in place of highway-env's observation; around a `TrackedEnv`.

    The observation is a dict: `ego` (3,) speed [m/s], yaw rate [rad/s], offset from the lane's centre [m]; `tracks`
    (K, 30), `class_probability` (K, 7), `mask` (K,) as in `Rows`. `info["track_ids"]` (K,) are the ids of the rows: a
    track keeps its id for life, whatever its row.
    """

    def __init__(self, env: gym.Env, size: int = 16, existence: float = 0.1, scale: bool = False) -> None:
        """Replace the observation.

        Args:
            env: a `TrackedEnv`, or wrappers around one.
            size: K, the number of rows.
            existence: tracks with an existence probability above this are observed, reported or not.
            scale: divide by the fixed numbers of docs/track-observation.md, for networks; without it units are SI.

        Raises:
            TypeError: `env` has no tracker.
            ValueError: no row, or a probability outside 0 to 1.
        """
        if not env.has_wrapper_attr("current_tracks") and not env.has_wrapper_attr("warm_up"):
            raise TypeError(f"env must have a tracker, got {env}; wrap it in testbed.TrackedEnv first")
        if isinstance(size, bool) or not isinstance(size, int) or size < 1:
            raise ValueError(f"size must be a whole number of rows from 1 on, got {size!r}")
        if not 0 <= existence < 1:
            raise ValueError(f"existence must be a probability from 0 to below 1, got {existence!r}")
        gym.utils.RecordConstructorArgs.__init__(self, size=size, existence=existence, scale=scale)
        gym.Wrapper.__init__(self, env)
        self.size, self.existence, self.scale = size, existence, scale
        self.observation_space = Dict(
            {
                "ego": Box(-np.inf, np.inf, (3,), np.float32),
                "tracks": Box(-np.inf, np.inf, (size, len(COLUMNS)), np.float32),
                "class_probability": Box(0.0, 1.0, (size, len(CLASSES)), np.float32),
                "mask": MultiBinary(size),
            }
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        _, info = self.env.reset(seed=seed, options=options)
        observation, ids = self.observation()
        return observation, {**info, "track_ids": ids}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Simulate one period of the planner."""
        _, reward, terminated, truncated, info = self.env.step(action)
        observation, ids = self.observation()
        return observation, reward, terminated, truncated, {**info, "track_ids": ids}

    def observation(self) -> tuple[dict[str, NDArray], NDArray]:
        """What there is to observe now, and the ids (K,) of its rows."""
        return self.get_wrapper_attr("observe_tracks")(self.size, self.existence, self.scale)
