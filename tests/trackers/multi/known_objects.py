"""Tracks and scans made by hand, and a filter that keeps them as they are: every gate can be computed on paper."""

from dataclasses import dataclass

import numpy as np

from trackers import Scan
from trackers.filter import UpdateInfo
from trackers.multi.tracks import Tracks


@dataclass(frozen=True)
class KnownObjects:
    """A filter whose state is its prior: nothing moves it, no detection corrects it."""

    def init(self, estimate):
        return estimate

    def predict(self, state, dt):
        return state

    def update(self, state, scan):
        n = scan.mask.sum(-1)
        return state, UpdateInfo(n, np.zeros((*n.shape, 2)), np.tile(np.eye(2), (*n.shape, 1, 1)))

    def estimate(self, state):
        return state


def tracks_of(estimate, existence=0.9):
    """Tracks (T,) of an estimate (T,), numbered from 0 and seen often."""
    T = len(estimate.pose)
    sure = np.broadcast_to(np.asarray(existence, float), T).copy()
    return Tracks(np.arange(T), sure, np.full(T, 9), np.ones(T), np.ones(T, bool), estimate, estimate, T)


def scan_of(xy, noise, rate=np.nan):
    """Detections xy (M, 2) [m] with range rates (M,) [m/s] of a radar that rests at the origin and faces along x."""
    scan = Scan.from_xy(np.array(xy, float), noise=noise)
    polar = scan.polar.copy()
    polar[:, 2] = rate
    return scan._replace(polar=polar)
