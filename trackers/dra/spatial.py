"""Where the detections of a body lie: the five regions as a density, for the association of many objects.

Equations: docs/methods/data-regions.md.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from trackers.estimate import Estimate
from trackers.geometry import rotation
from trackers.scan import Scan

LEAST = 1e-300
ROOT_2PI = np.sqrt(2 * np.pi)


def log_density(e: NDArray, size: NDArray, std: NDArray, prior: NDArray) -> NDArray:
    """Log density (G,) [1/m^2] at e (G, 2) [m] from the centre, in body axes, of points even on sides or inside.

    size (G, 2) [m]; std (G, 2) [m] of the noise that blurs all regions; prior (G, 5) of the regions.
    """
    half = size / 2
    # On the far side of an axis both terms are near one: the mirrored tail keeps its digits.
    a = np.abs(e)
    even = (ndtr((half - a) / std) - ndtr((-half - a) / std)) / size  # (DRA.37a)
    ahead, behind = (np.exp(-0.5 * ((e - s * half) / std) ** 2) / (std * ROOT_2PI) for s in (1, -1))
    front, left = (ahead * even[:, ::-1]).T
    rear, right = (behind * even[:, ::-1]).T
    regions = np.stack([front, right, rear, left, even.prod(-1)], -1)
    return np.log(np.maximum((prior * regions).sum(-1), LEAST))  # (DRA.37b)


def log_spatial(
    estimate: Estimate, prior: NDArray, scan: Scan, track: NDArray, detection: NDArray, sigma: float, surface: float
) -> NDArray:
    """Log density (G,) [1/m^2] of pairs of track (G,) and detection (G,); prior (G, 5) of the regions of each pair.

    The noise of the detection (sigma [m] where unknown), the roughness of the surface [m] and the uncertainty of
    centre and size blur the density.
    """
    pose, size = estimate.pose[track], estimate.size[track]
    body = rotation(pose[:, 2])
    C = scan.position_noise(sigma)[detection] + estimate.cov[track, :2, :2]
    variance = (body * (C @ body)).sum(-2) + surface**2 + estimate.size_std[track] ** 2 / 4
    e = (body.mT @ (scan.xy[detection] - pose[:, :2])[..., None])[..., 0]
    return log_density(e, size, np.sqrt(variance), prior)
