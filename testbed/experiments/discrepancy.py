"""What is most wrong in the planner's view of the traffic ahead, in words: names the cause where two drives part."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.scene import Scene
from testbed.environment.perception import truth_tracks
from testbed.environment.sources.substitution import match
from testbed.log.paths import vehicle
from trackers.estimate import Estimate
from trackers.geometry import rotation, to_frame
from trackers.multi.tracks import Tracks

AHEAD, BEHIND, BESIDE = 100.0, 10.0, 6.0  # [m] where traffic matters to the ego: along and across its heading
UNITS = {"near edge": 1.0, "speed": 1.0, "speed across": 0.5, "heading": 0.1}  # errors that weigh alike; SI
MISSING = 4.0  # a missing object, or a false track, weighs as much as an error of so many units


class Discrepancy(NamedTuple):
    """The largest difference between the truth and the tracks."""

    size: float  # in units, less with distance
    text: str


NOTHING = Discrepancy(0.0, "nothing differs")


def largest(scene: Scene, visible: NDArray, tracks: Tracks) -> Discrepancy:
    """The largest difference near the ego, between all objects and the reported tracks.

    visible (N,): share of each object that is visible; one that is hidden is called so.
    """
    truth, own = truth_tracks(scene), tracks._replace(state=None).reported
    partner = match(truth, own)
    found = [NOTHING]
    place = to_frame(scene.ego.pose, truth.estimate.pose[:, None, :2])[:, 0]
    for row in np.flatnonzero(_matters(place)):
        name = f"{vehicle(int(truth.id[row]))}, {place[row, 0]:.0f} m ahead"
        weight = 1 / (1 + abs(place[row, 0]) / 50.0)
        if partner[row] < 0:
            how = "visible, without a reported track" if visible[row] > 0 else "hidden, without a reported track"
            found.append(Discrepancy(MISSING * weight, f"{name}: {how}"))
        else:
            errors = _errors(scene.ego.pose[2], truth.estimate, int(row), own.estimate, int(partner[row]))
            what = max(errors, key=lambda key: abs(errors[key]) / UNITS[key])
            unit = {"near edge": "m", "heading": "rad"}.get(what, "m/s")
            size = weight * abs(errors[what]) / UNITS[what]
            found.append(Discrepancy(size, f"{name}: {what} {errors[what]:+.2f} {unit}"))
    false = np.setdiff1d(np.arange(len(own.id)), partner)
    place = to_frame(scene.ego.pose, own.estimate.pose[false, None, :2])[:, 0]
    for row in np.flatnonzero(_matters(place)):
        weight = 1 / (1 + abs(place[row, 0]) / 50.0)
        name = f"track {own.id[false[row]]}, {place[row, 0]:.0f} m ahead"
        found.append(Discrepancy(MISSING * weight, f"{name}: no object there"))
    return max(found, key=lambda d: d.size)


def _matters(place: NDArray) -> NDArray:
    """Mask of positions (K, 2) [m] in the frame of the ego."""
    return (place[:, 0] > -BEHIND) & (place[:, 0] < AHEAD) & (np.abs(place[:, 1]) < BESIDE)


def _errors(heading: float, truth: Estimate, i: int, own: Estimate, j: int) -> dict[str, float]:
    """Errors of row j of the tracks against row i of the truth in the frame of an ego with this heading [rad]."""
    back = rotation(heading).T
    near = _near_edge(own, j, back[0]) - _near_edge(truth, i, back[0])
    speed, across = back @ (own.velocity[j] - truth.velocity[i])
    turn = float(np.angle(np.exp(1j * (own.pose[j, 2] - truth.pose[i, 2]))))  # of the box
    return {"near edge": float(near), "speed": float(speed), "speed across": float(across), "heading": turn}


def _near_edge(estimate: Estimate, row: int, along: NDArray) -> float:
    """Where the box of one estimate begins in the direction `along` (2,) [m]."""
    pose = estimate.pose[row]
    return pose[:2] @ along - np.abs(rotation(pose[2]).T @ along) @ estimate.size[row] / 2
