"""Acceleration behind a leader: the Intelligent Driver Model, with milder braking for a leader that cuts in.

Symbols: Kesting, Treiber, Helbing (2010), "Enhanced intelligent driver model to access the impact of driving strategies
on traffic capacity", Phil. Trans. R. Soc. A 368, 4585. v, v_l [m/s] are the speeds of the ego and of the leader, s [m]
is the gap between the bumpers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SMALLEST = 0.1  # [m] a shorter gap, or an overlap, counts as this gap


@dataclass(frozen=True)
class CarFollowing:
    """IDM with the constant-acceleration heuristic (CAH); the acceleration of the leader is taken as 0.

    CAH is the least braking that avoids a collision. Where IDM brakes harder than CAH, the two are mixed.
    """

    gap: float = 3.0  # [m] s_0, between bumpers at standstill
    headway: float = 1.4  # [s] T
    accel: float = 2.5  # [m/s^2] a
    brake: float = 3.0  # [m/s^2] b, comfortable
    coolness: float = 0.99  # c: 0 is IDM alone

    def free(self, v: float, target: float) -> float:
        """Acceleration [m/s^2] towards a target speed [m/s] on a free road, no harder than comfortable when above it.

        Treiber, Kesting (2013), "Traffic flow dynamics", eqs. (11.25) and (11.26): the improved IDM.
        """
        if v <= target:
            return self.accel * (1 - (max(v, 0.0) / max(target, 0.1)) ** 4)
        return -self.brake * (1 - (max(target, 0.0) / v) ** (4 * self.accel / self.brake))

    def follow(self, v: float, target: float, s: NDArray, v_l: NDArray) -> NDArray:
        """Acceleration (N,) [m/s^2] behind each of N leaders at gaps s (N,) with speeds v_l (N,) along one's path."""
        idm = self.free(v, target) - self.accel * (self.desired_gap(v, v_l) / np.maximum(s, SMALLEST)) ** 2
        cah = -(np.maximum(v - v_l, 0.0) ** 2) / (2 * np.maximum(s, SMALLEST))
        mixed = (1 - self.coolness) * idm + self.coolness * (cah + self.brake * np.tanh((idm - cah) / self.brake))
        return np.where(idm >= cah, idm, mixed)

    def desired_gap(self, v: float | NDArray, v_l: float | NDArray) -> NDArray:
        """The desired gap s* [m] of IDM to a leader."""
        return self.gap + np.maximum(v * self.headway + v * (v - v_l) / (2 * np.sqrt(self.accel * self.brake)), 0.0)

    def imposed(self, v: NDArray, v_l: float, s: NDArray, headway: float) -> NDArray:
        """Braking (N,) [m/s^2] that IDM with a time headway [s] asks of N followers behind a new leader."""
        closing = np.maximum(v * (v - v_l) / (2 * np.sqrt(self.accel * self.brake)), 0.0)
        return self.accel * ((self.gap + np.maximum(v * headway, 0.0) + closing) / np.maximum(s, SMALLEST)) ** 2
