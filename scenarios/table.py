"""A prescribed course as a table over time, read between its rows."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


class CourseTable:
    """A course over time: rows t [s], x, y [m], heading [rad], vx, vy [m/s], yaw rate [rad/s].

    Between the rows a cubic through both states and rates (Hermite), so velocity is the derivative of position; past
    the last row straight on. Immutable, so copies of a simulation share it.
    """

    COLUMNS = 7

    def __init__(self, rows: ArrayLike) -> None:
        rows = np.array(rows, float)
        if rows.ndim != 2 or rows.shape[1] != self.COLUMNS or len(rows) < 2:
            raise ValueError(
                f"table must be (K >= 2, 7): t, x, y, heading, vx, vy, yaw_rate; got {rows.shape}; "
                "add the rates of the trajectory"
            )
        if not np.isfinite(rows).all() or (np.diff(rows[:, 0]) <= 0).any():
            raise ValueError(f"table must be finite and increase in t, got {len(rows)} rows that do not; sort them")
        rows[:, 3] = np.unwrap(rows[:, 3])
        rows.flags.writeable = False
        self.rows = rows

    def __deepcopy__(self, memo: dict) -> "CourseTable":
        return self

    @property
    def start(self) -> float:
        """Time [s] of the first row."""
        return float(self.rows[0, 0])

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration [m/s^2] of the course: how much of a maneuver it is."""
        rate = np.diff(self.rows[:, 4:6], axis=0) / np.diff(self.rows[:, 0])[:, None]
        return float(np.hypot(rate[:, 0], rate[:, 1]).max())

    def at(self, t: float) -> tuple[NDArray, NDArray]:
        """Pose (3,) x, y [m], heading [rad] and its rate (3,) at time t [s]; t before the start is the start."""
        T = self.rows[:, 0]
        t = max(t, self.start)
        if t >= T[-1]:
            pose, rate = self.rows[-1, 1:4], self.rows[-1, 4:] * [1, 1, 0]
            return pose + (t - T[-1]) * rate, rate
        k = int(np.searchsorted(T, t, side="right")) - 1
        h = T[k + 1] - T[k]
        u = (t - T[k]) / h
        (p, v), (q, w) = (np.split(self.rows[j, 1:], 2) for j in (k, k + 1))
        d = (q - p) / h
        pose = p + h * u * (v + u * (3 * d - 2 * v - w + u * (v + w - 2 * d)))
        rate = v + u * (2 * (3 * d - 2 * v - w) + 3 * u * (v + w - 2 * d))
        return pose, rate
