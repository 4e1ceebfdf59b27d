"""The laws of a multi-object tracker, `start` and `step`; a filter is tried in the tracker of `trackers.multi`.

The scene is a road with one car or none, seen from behind by a radar at rest at the origin.
"""

from typing import Any

import numpy as np

from testbed.check.draws import Broken, arrays, check_equal, check_finite, leaves
from trackers.scan import Scan, SensorModel

RADAR = SensorModel(max_range=150.0, fov=2.0, clutter=1.0)
DT = 0.1  # [s]
SPEED, LENGTH, WIDTH = 10.0, 4.6, 1.86  # [m/s], [m]


def rear_scan(rng: np.random.Generator, x: float, n: int = 8) -> Scan:
    """N detections of the rear of a car whose centre is x [m] ahead and that drives on at `SPEED`."""
    xy = np.stack([x - LENGTH / 2 + rng.exponential(0.2, n), rng.uniform(-WIDTH / 2, WIDTH / 2, n)], -1)
    noise = np.array([RADAR.sigma_range, RADAR.sigma_azimuth, RADAR.sigma_rate])
    scan = Scan.from_xy(xy, noise=noise)
    rate = SPEED * scan.sight[..., 0] + rng.normal(0, noise[2], n)
    return scan._replace(polar=np.concatenate([scan.polar[..., :2], rate[..., None]], -1))


def drive(tracker: Any, scans: int = 15, seed: int = 1) -> Any:
    """Tracks after so many scans of a car that starts 20 m ahead."""
    rng, tracks = np.random.default_rng(seed), tracker.start()
    for k in range(scans):
        tracks, _ = tracker.step(tracks, rear_scan(rng, 20.0 + SPEED * DT * k), DT if k else 0.0)
    return tracks


def a_car_in_plain_view_becomes_one_track(tracker: Any) -> None:
    """After 15 scans of a car there is one reported track, within 3 m and 3 m/s of it, and nothing else."""
    reported = drive(tracker).reported.estimate
    check_finite(reported, "the track of a car in plain view")
    if len(reported.pose) != 1:
        raise Broken(f"a car in plain view has {len(reported.pose)} reported tracks after 15 scans; it should have one")
    off = float(np.hypot(*(reported.pose[0, :2] - [20.0 + SPEED * DT * 14, 0.0])))
    slow = float(np.hypot(*(reported.velocity[0] - [SPEED, 0.0])))
    if not (off < 3.0 and slow < 3.0):
        raise Broken(f"the track of a car in plain view is {off:.1f} m and {slow:.1f} m/s off after 15 scans")


def a_car_that_is_gone_loses_its_track(tracker: Any) -> None:
    """Twenty empty scans later no track of the car is reported."""
    tracks, nothing = drive(tracker), Scan.from_xy(np.zeros((0, 2)))
    for _ in range(20):
        tracks, _ = tracker.step(tracks, nothing, DT)
    if count := len(tracks.reported.id):
        raise Broken(f"{count} tracks are still reported 2 s after the last detection of a car that is gone")


def nothing_seen_is_nothing_tracked(tracker: Any) -> None:
    """Empty scans make no track, also where the first has no time before it."""
    tracks, nothing = tracker.start(), Scan.from_xy(np.zeros((0, 2)))
    for dt in (0.0, DT, 1.0):
        tracks, _ = tracker.step(tracks, nothing, dt)
    if count := len(tracks.reported.id):
        raise Broken(f"empty scans have made {count} tracks")


def a_tracker_remembers_nothing(tracker: Any) -> None:
    """The same scans give the same tracks a second time, and `step` leaves the tracks that it is given as they were."""
    law = "the same scans gave other tracks the second time; all state of a tracker must be in its Tracks"
    tracks = drive(tracker)
    check_equal(drive(tracker), tracks, 0, 0, law)
    copies = [np.array(a) for a in arrays(tracks)]
    tracker.step(tracks, rear_scan(np.random.default_rng(2), 35.0), DT)
    for (name, now), then in zip(leaves(tracks), copies, strict=True):
        check_equal(now, then, 0, 0, f"step writes into the tracks that it is given ({name}); work on a copy")
