"""Detections of boxes at rest, and a filter with a size posterior that has seen them for some scans."""

from dataclasses import replace

import numpy as np

from trackers import Scan, find, prior
from trackers.composed import Composed
from trackers.size.fleet import FLEET, Fleet, Load
from trackers.size.posterior import SizePosterior

INNER = replace(find("htg-map"), shape_std=(0.03, 0.05))
ROUNDED = Fleet(tuple(replace(c, load=Load(), inset=(0.0, 0.0)) for c in FLEET))
WHOLE = Fleet(tuple(replace(c, rounding=(0.0, 0.0)) for c in ROUNDED.classes))  # detections fill all of these bodies
NEAR = 25.0  # [m] distance of the rear end
NOISE = 0.1  # [m]
DT = 1 / 15


def sized(place=INNER, **parameters):
    """A filter of the place with a size posterior, for which bodies at rest count as if they drove."""
    return Composed(place, size=SizePosterior(**({"standing": 6} | parameters)))


def behind_rear(rng, n, length, width, upto=np.inf):
    """n detections (n, 2) of a box from behind: four of five just behind the rear, one even over the length.

    Nothing beyond the distance upto [m] is detected.
    """
    found = np.zeros((0, 2))
    while len(found) < n:
        depth = np.where(rng.random(n) < 0.2, rng.random(n) * length, rng.exponential(0.12, n))
        xy = np.stack([NEAR + depth, width * (rng.random(n) - 0.5)], -1)
        found = np.concatenate([found, xy[xy[:, 0] < upto]])
    return found[:n] + rng.normal(0, NOISE, (n, 2))


def beside(rng, n, length, width, away=10.0):
    """The same from the side, over the whole side."""
    depth = np.where(rng.random(n) < 0.2, rng.random(n) * width, rng.exponential(0.12, n))
    xy = np.stack([length * (rng.random(n) - 0.5), away + depth], -1)
    return xy + rng.normal(0, NOISE, (n, 2))


def scan_of(xy):
    """A scan from the origin with the same noise along and across each line of sight."""
    noise = np.full((len(xy), 3), np.nan)
    noise[:, 0], noise[:, 1] = NOISE, NOISE / np.hypot(*xy.T)
    return Scan.from_xy(xy, noise=np.full((1, 3), np.nan))._replace(noise=noise)


def seen(draw, scans, start, size, seed=0, filter=None):
    """Filter and state after so many scans of draw(rng), begun with a box of a size (2,) [m] at start (3,)."""
    f, rng = sized(fleet=WHOLE) if filter is None else filter, np.random.default_rng(seed)
    state = f.init(prior(start, size=size))
    for _ in range(scans):
        state = f.update(f.predict(state, DT), scan_of(draw(rng)))[0]
    return f, state


def rear_start(length):
    """Pose of a box of this length [m] whose rear is in its place."""
    return NEAR + length / 2, 0.0, 0.0
