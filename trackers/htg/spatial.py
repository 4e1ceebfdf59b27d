"""Where the detections of a track lie: the density as the likelihood of the association.

Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import rotation
from trackers.htg.bins import HTGTable, log_masses
from trackers.htg.density import log_density
from trackers.scan import Scan


def log_spatial(
    table: HTGTable, estimate: Estimate, scan: Scan, track: NDArray, detection: NDArray, sigma: float
) -> NDArray:
    """Log density (G,) [1/m^2] of pairs of track (G,) and detection (G,) under the bin of that detection's aspect.

    The noise of the detection and the uncertainty of the centre blur the density; unknown noise is sigma [m].
    """
    M = scan.mask.shape[-1]
    sensor = np.broadcast_to(scan.pose[:, :2], (M, 2))[detection]
    pose, half = estimate.pose[track], estimate.size[track] / 2
    index = table.bin_at(pose[:, :2], pose[:, 2], estimate.size[track, 0], sensor)
    p = table.of(index)
    h, shift = table.warp(half, index)
    C = scan.position_noise(sigma)[detection] + estimate.cov[track, :2, :2]
    body = rotation(pose[:, 2])
    e = (body.mT @ (scan.xy[detection] - pose[:, :2])[..., None])[..., 0]
    axes = body @ (rotation(p.theta) / h[:, :, None])  # columns: turned axes of unit coordinates, pulled back
    noise = (axes * (C @ axes)).sum(-2)  # (HTG.40)
    return log_density((e - shift) / h, p, noise, log_masses(table)[index]) - np.log(h[:, 0] * h[:, 1])  # (HTG.40)
