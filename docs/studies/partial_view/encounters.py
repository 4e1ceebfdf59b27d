"""One vehicle, seen by our radars from known sides, many runs at once: what a filter's errors are along and across it.

Association is known: every filter gets the detections of the vehicle and no others, so what is left is the spatial
model. The prior is no better than that of a track: it is drawn about the truth.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.contours import CONTOURS
from sensors.radar import Radar
from sensors.scene import Ego, Scene, boxes_scene
from studies.plus_minus import PlusMinus
from studies.runs import every_sensor
from testbed.evaluation.intervals import student_interval
from testbed.evaluation.metrics import contour_iou
from trackers.estimate import Estimate, prior
from trackers.geometry import box_corners, rotation, to_world, unit
from trackers.scan import Scan

STEP = 0.1  # [s]
EGO_SIZE = np.array([4.7, 1.9])  # [m]
SPREAD = 0.07  # relative, of the true sizes about those of the class
POSITION_STD, VELOCITY_STD, HEADING_STD = 0.5, 1.0, 0.05  # [m, m/s, rad] of the prior


class Motion(NamedTuple):
    """A vehicle, or an ego, in K frames."""

    pose: NDArray  # (K, 3) [m, m, rad]
    velocity: NDArray  # (K, 2) [m/s]
    yaw_rate: NDArray  # (K,) [rad/s]


class Encounter(NamedTuple):
    """A vehicle and the egos that see it, each with the radar."""

    view: str  # what they see of it
    vehicle: Motion
    egos: tuple[Motion, ...]


class EncounterRuns(NamedTuple):
    """R runs of an encounter with vehicles of one class."""

    vehicle: Motion
    size: NDArray  # (R, 2) [m]
    outline: NDArray  # (R, C, 2) in the unit frame
    scans: tuple[Scan, ...]  # K of them with the axis R
    start: Estimate  # (R,) the prior in the first frame


class BodyErrors(NamedTuple):
    """Errors of R runs in K frames, in the frame of the body."""

    along: NDArray  # (R, K) [m] of the centre, ahead is positive
    across: NDArray  # (R, K) [m] to the left is positive in a frame with y to the left of x
    length: NDArray  # (R, K) [m]
    iou: NDArray  # (R, K) of contour and true outline
    nees: NDArray  # (R, K) of the centre, 2 is ideal


def straight(start: tuple[float, float, float], speed: float, frames: int) -> Motion:
    """Motion at constant speed [m/s] from a pose (3,)."""
    t = STEP * np.arange(frames)
    velocity = speed * unit(np.full(frames, start[2]))
    xy = np.array(start[:2]) + t[:, None] * velocity
    return Motion(np.column_stack([xy, np.full(frames, start[2])]), velocity, np.zeros(frames))


def circle(centre: tuple[float, float], radius: float, speed: float, frames: int) -> Motion:
    """Motion counter-clockwise about a centre [m]."""
    rate = speed / radius
    angle = rate * STEP * np.arange(frames)
    xy = np.array(centre) + radius * unit(angle)
    heading = angle + np.pi / 2
    return Motion(np.column_stack([xy, heading]), speed * unit(heading), np.full(frames, rate))


def encounters() -> tuple[Encounter, ...]:
    """From a full to a one-sided view; speeds of a country road, and of a yard for the circle."""
    n = 80
    lead = straight((0.0, 0.0, 0.0), 15.0, n)
    around = ((18.0, 0.0, np.pi), (-18.0, 0.0, 0.0), (0.0, 14.0, -np.pi / 2), (0.0, -14.0, np.pi / 2))
    formation = tuple(Motion(lead.pose + np.array([x, y, a]), lead.velocity, lead.yaw_rate) for x, y, a in around)
    return (
        Encounter("all around", lead, formation),
        Encounter("circle", circle((22.0, 0.0), 8.0, 6.0, n), (straight((0.0, 0.0, 0.0), 0.0, n),)),
        Encounter("passing", lead, (straight((-24.0, -3.75, 0.0), 21.0, n),)),
        Encounter("oncoming", lead, (straight((150.0, 3.75, np.pi), 5.0, n),)),
        Encounter("behind", lead, (straight((-22.0, 0.5, 0.0), 15.0, n),)),
    )


def simulate(encounter: Encounter, radar: Radar, kind: str, runs: int, rng: np.random.Generator) -> EncounterRuns:
    """The same encounter `runs` times, each time with a vehicle of another size."""
    body = CONTOURS[kind]
    size = body.size * (1 + SPREAD * rng.standard_normal((runs, 2)))
    outline = np.stack([body.fit(s) / s for s in size])
    alone = every_sensor(radar, lambda sensor: replace(sensor, clutter=0.0))
    frames = range(len(encounter.vehicle.pose))
    scans = tuple(padded([detections(encounter, k, alone, kind, s, rng) for s in size]) for k in frames)
    start = drawn_prior(encounter.vehicle, body.size, runs, rng)
    return EncounterRuns(encounter.vehicle, size, outline, scans, start)


def detections(encounter: Encounter, k: int, radar: Radar, kind: str, size: NDArray, rng: np.random.Generator) -> Scan:
    """Detections of the vehicle by the radars of all egos in frame k."""
    now = Motion(*(leaf[k] for leaf in encounter.vehicle))
    scans = []
    for ego in encounter.egos:
        scan, origin = radar.scan(scene_of(now, Motion(*(leaf[k] for leaf in ego)), kind, size), rng)
        scans.append([leaf[origin.object == 0] for leaf in scan[:6]])
    joined = (np.concatenate(leaves) for leaves in zip(*scans, strict=True))
    return Scan(*joined)


def scene_of(vehicle: Motion, ego: Motion, kind: str, size: NDArray) -> Scene:
    """One vehicle before one ego."""
    observer = Ego(ego.pose, ego.velocity, float(ego.yaw_rate), EGO_SIZE, box_corners(ego.pose, EGO_SIZE))
    scene = boxes_scene(vehicle.pose, size, vehicle.velocity, vehicle.yaw_rate, observer, dt=STEP)
    return scene._replace(bodies=scene.bodies._replace(outline=(CONTOURS[kind].place(vehicle.pose, size),)))


def padded(scans: list[Scan]) -> Scan:
    """Scans of R runs as one with the axis R."""
    M = max(1, *(len(scan.mask) for scan in scans))

    def stack(leaf: int) -> NDArray:
        parts = [np.asarray(scan[leaf]) for scan in scans]
        return np.stack([np.concatenate([p, np.zeros((M - len(p), *p.shape[1:]), p.dtype)]) for p in parts])

    return Scan(*[*map(stack, range(6)), np.zeros((len(scans), 6))])


def drawn_prior(vehicle: Motion, size: NDArray, runs: int, rng: np.random.Generator) -> Estimate:
    """Priors (R,) about the true pose and velocity in the first frame; the size is that of the class."""
    draw = rng.standard_normal((runs, 5))
    pose = vehicle.pose[0] + draw[:, :3] * (POSITION_STD, POSITION_STD, HEADING_STD)
    speed = np.linalg.norm(vehicle.velocity[0]) + VELOCITY_STD * draw[:, 3]
    return prior(
        pose,
        speed[:, None] * unit(pose[:, 2]),
        vehicle.yaw_rate[0] + 0.05 * draw[:, 4],
        size,
        POSITION_STD,
        VELOCITY_STD,
        size * SPREAD,
        HEADING_STD,
        0.05,
    )


def follow(filter: Any, runs: EncounterRuns) -> BodyErrors:
    """Errors of a filter in all frames of all runs."""
    state = filter.init(runs.start)
    rows: list[tuple[NDArray, ...]] = []
    for k, scan in enumerate(runs.scans):
        state = filter.predict(state, STEP) if k else state
        state, _ = filter.update(state, scan)
        rows.append(errors(filter.estimate(state), runs, k))
    return BodyErrors(*(np.stack(column, -1) for column in zip(*rows, strict=True)))


def errors(found: Estimate, runs: EncounterRuns, k: int) -> tuple[NDArray, ...]:
    """Errors (R,) in frame k, in the order of `BodyErrors`."""
    true = np.broadcast_to(runs.vehicle.pose[k], found.pose.shape)
    d = found.pose[..., :2] - true[..., :2]
    body = (d[..., None, :] @ rotation(true[..., 2]))[..., 0, :]
    nees = (d * np.linalg.solve(found.cov[..., :2, :2], d[..., None])[..., 0]).sum(-1)
    outline = to_world(true, runs.outline * runs.size[:, None])
    drawn = box_corners(found.pose, found.size) if found.contour is None else found.contour
    return body[..., 0], body[..., 1], found.size[..., 0] - runs.size[:, 0], contour_iou(drawn, outline), nees


def measure(e: BodyErrors, since: int) -> dict[str, PlusMinus]:
    """Means over the runs from frame `since` on: biases, root mean square of the length, IoU and NEES."""
    late = BodyErrors(*(leaf[:, since:] for leaf in e))
    found = {
        "along": late.along,
        "across": late.across,
        "length": late.length,
        "length rms": late.length**2,
        "iou": late.iou,
        "nees": late.nees,
    }
    out = {name: over_runs(value.mean(1)) for name, value in found.items()}
    square = out["length rms"]
    root = float(np.sqrt(square.value))
    out["length rms"] = PlusMinus(root, square.half / (2 * max(root, 1e-9)))
    return out


def over_runs(value: NDArray) -> PlusMinus:
    """Mean of a figure (R,) over independent runs with its interval."""
    mean, half = student_interval(value)
    return PlusMinus(float(mean), float(half))
