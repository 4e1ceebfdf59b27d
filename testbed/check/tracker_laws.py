"""The laws of a multi-object tracker, `start` and `step`; a filter is tried in the tracker of `trackers.multi`.

The scene is a road with one car or none, seen from behind by a radar at rest at the origin. A whole tracker may keep
what it likes in itself, such as filters of another library: `start` clears it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from testbed.check.draws import Broken, arrays, check_equal, check_finite, leaves
from testbed.environment.validation import check_output, check_tracks
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


def scans_of(scans: int, seed: int = 1) -> list[Scan]:
    """Scans of a car that starts 20 m ahead."""
    rng = np.random.default_rng(seed)
    return [rear_scan(rng, 20.0 + SPEED * DT * k) for k in range(scans)]


def histories(tracker: Any, scans: Sequence[Scan]) -> list[Any]:
    """Tracks after each of the scans, from a start on."""
    tracks, found = tracker.start(), []
    for k, scan in enumerate(scans):
        tracks, _ = tracker.step(tracks, scan, DT if k else 0.0)
        found.append(tracks)
    return found


def drive(tracker: Any, scans: int = 15) -> Any:
    """Tracks after so many scans of a car that starts 20 m ahead."""
    return histories(tracker, scans_of(scans))[-1]


def every_step_returns_what_can_be_tracks(tracker: Any) -> None:
    """Shapes fit, numbers are finite and plausible, ids differ: before a car comes, with it, and after it is gone.

    Each run has the same check at every step: `testbed.environment.validation`.
    """
    nothing, name = Scan.from_xy(np.zeros((0, 2))), type(tracker).__name__
    tracks = tracker.start()
    check_tracks(tracks, name, "start")
    for k, scan in enumerate([nothing, *scans_of(15), *[nothing] * 20]):
        output = tracker.step(tracks, scan, DT if k else 0.0)
        check_output(output, scan.mask.shape[-1], name, f"step {k}")
        tracks = output[0]


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


def a_car_keeps_its_id(tracker: Any) -> None:
    """From the first report of a car on, over 15 scans, its id stays."""
    ids = [int(i) for tracks in histories(tracker, scans_of(15)) for i in tracks.reported.id]
    if len({*ids}) > 1:
        raise Broken(f"a car in plain view has the ids {sorted({*ids})} within 15 scans; a track keeps its id for life")


def padding_does_not_matter(tracker: Any) -> None:
    """Rows behind the mask, here NaN, are no detections."""
    plain = scans_of(15)
    gap = np.full((2, 3), np.nan)
    padded = [s._replace(polar=np.vstack([s.polar, gap]), mask=np.append(s.mask, [False, False])) for s in plain]
    law = "rows of a scan whose mask is false change the tracks; use scan.polar[scan.mask] or scan.xy[scan.mask]"
    check_equal(_shown(histories(tracker, padded)[-1]), _shown(histories(tracker, plain)[-1]), law=law)


def a_start_begins_anew(tracker: Any) -> None:
    """The same scans after `start` give the same tracks a second time, and tracks once returned stay as they were."""
    law = "the same scans after start gave other tracks the second time; start must clear what the tracker keeps"
    first = histories(tracker, scans_of(15))
    copies = [np.array(a) for a in arrays(_shown(first[-1]))]
    check_equal(_shown(histories(tracker, scans_of(15))[-1]), _shown(first[-1]), 0, 0, law)
    tracker.step(first[-1], rear_scan(np.random.default_rng(2), 35.0), DT)
    for (name, now), then in zip(leaves(_shown(first[-1])), copies, strict=True):
        check_equal(now, then, 0, 0, f"step writes into tracks that others still use ({name}); return new arrays")


def _shown(tracks: Any) -> Any:
    """Tracks without what only the tracker itself reads, which may be of any kind."""
    return tracks._replace(state=None)
