"""Returns of turning wheels, with range rates of their own; docs/methods/radar.md, section 6.

Kellner, Barjenbruch, Klappstein, Dickmann, Dietmayer (2015), "Wheel extraction based on micro doppler distribution
using high-resolution radar", ICMIM: the rim of a rolling wheel moves with 0 to twice the speed of its vehicle.
"""

import numpy as np
from numpy.typing import NDArray

from sensors.reflections import Mounted, polar_of
from sensors.returns import Returns
from sensors.scene import Bodies, local_boxes
from trackers.geometry import rotation

OVERHANG, INSET, SPREAD = 0.82, 0.1, 0.15  # [m] of a wheel from the end and the side of a body, and about its axle
ROLLING = 0.5  # [m/s] below which a wheel is as still as its body


def with_wheels(returns: Returns, share: NDArray, bodies: Bodies, at: Mounted, rng: np.random.Generator) -> Returns:
    """The returns of vehicles, a share (S,) of those of a body that is seen from its side taken by a wheel.

    The share falls with the square of the sine of the aspect: from ahead and behind no wheel is seen to turn.
    """
    x, spread = rng.random((4, len(returns.sensor))), rng.standard_normal((2, len(returns.sensor)))
    s, b = returns.sensor, returns.body
    centre, heading = bodies.pose[b, :2], rotation(bodies.pose[b, 2])
    forward, left = heading[..., 0], heading[..., 1]
    sight = centre - at.pose[s, :2]
    sight = sight / np.maximum(np.hypot(sight[:, 0], sight[:, 1]), 1e-12)[:, None]
    across, speed = (left * sight).sum(-1), (bodies.velocity[b] * forward).sum(-1)
    chosen = (x[0] < share[s] * across**2) & (np.abs(speed) > ROLLING)  # (RAD.40)
    low, high = local_boxes(bodies)
    place = np.where(x[1] < 0.5, low[b, 0] + OVERHANG, high[b, 0] - OVERHANG) + SPREAD * spread[0]
    side = np.where(across > 0, low[b, 1] + INSET, high[b, 1] - INSET) + SPREAD * spread[1] / 3
    xy = centre + place[:, None] * forward + side[:, None] * left  # (RAD.41)
    turning = np.sqrt(x[2]) * np.cos(2 * np.pi * x[3])  # of a point anywhere on the disc
    rate = returns.polar[:, 2] + turning * speed * (forward * sight).sum(-1)  # (RAD.42)
    return returns._replace(polar=np.where(chosen[:, None], polar_of(at.pose[s], xy, rate), returns.polar))
