"""The sensors of a recording: their names, and the data sheets that trackers get."""

from dataclasses import fields
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.replay.columns import TWO_SIDED
from testbed.replay.loaded import Loaded
from trackers.scan import DepthProfile, SensorModel

OPTIONAL = ("sigma_rate", "max_rate", "fold_rate", "count_at_15m", "count_falloff", "count_max", "clutter")


class SensorSheets(NamedTuple):
    """S sensors."""

    names: tuple[str, ...]
    models: tuple[SensorModel, ...]
    rate: NDArray  # (S,) [1/s] scans, NaN where it is not given

    @property
    def sigma(self) -> NDArray:
        """Standard deviations (S, 3) of range [m], azimuth [rad], range rate [m/s]."""
        return np.array([(m.sigma_range, m.sigma_azimuth, m.sigma_rate) for m in self.models])

    @property
    def mount(self) -> NDArray:
        """Places (S, 3) on the vehicle: x, y [m], heading [rad]."""
        return np.array([model.mount for model in self.models], float)

    def rows_of(self, table: Loaded) -> NDArray:
        """Which sensor (N,) each row of a table is of; ValueError, in one sentence, for one that is not known."""
        rows, number = np.unique(table["sensor"], return_inverse=True)
        known = np.array([self.names.index(name) if name in self.names else -1 for name in rows.tolist()], int)
        sensor = known[number] if len(known) else np.zeros(0, int)
        table.check(
            "sensor",
            sensor < 0,
            lambda row: f"there is no sensor {str(table['sensor'][row])!r}",
            f"the table sensors has {', '.join(self.names)}",
        )
        return sensor


def sensor_sheets(table: Loaded) -> SensorSheets:
    """The sensors of the table; ValueError, in one sentence, where they cannot be."""
    if not table.rows:
        raise ValueError(f"{table.file} has no row; give one for each sensor")
    names = tuple(table["name"].tolist())
    repeated = np.array([not name or name in names[:row] for row, name in enumerate(names)], bool)
    table.check("name", repeated, lambda row: f"{names[row]!r} is empty or there already", "give each its own name")
    models = tuple(_model(table, row) for row in range(table.rows))
    return SensorSheets(names, models, table.numbers("rate", np.nan))


def _model(table: Loaded, row: int) -> SensorModel:
    given: dict[str, Any] = {
        name: float(table[name][row]) for name in OPTIONAL if name in table and not isnan(table[name][row])
    }
    x, y, yaw, *rest = (
        float(table[n][row]) for n in ("x", "y", "yaw", "max_range", "fov", "sigma_range", "sigma_azimuth")
    )
    reach, fov, sigma_range, sigma_azimuth = rest
    try:
        profile = _profile(table, row)
    except ValueError as error:
        raise ValueError(f"{table.file}, row {row + 1}: {error}; correct the columns profile_...") from None
    return SensorModel((x, y, yaw), reach, fov, sigma_range, sigma_azimuth, profile=profile, **given)


def _profile(table: Loaded, row: int) -> DepthProfile:
    """Where detections lie on a body: what the row gives, the defaults for the rest."""
    usual = DepthProfile()
    values: dict[str, Any] = {}
    for one in fields(DepthProfile):
        name = f"profile_{one.name}"
        if one.name in TWO_SIDED:
            sides = zip((f"{name}_along", f"{name}_across"), getattr(usual, one.name), strict=True)
            values[one.name] = tuple(_cell(table, side, row, default) for side, default in sides)
        elif name in table and not isnan(table[name][row]):  # else its default, which may depend on the others
            values[one.name] = float(table[name][row])
    return DepthProfile(**values)


def _cell(table: Loaded, name: str, row: int, default: float) -> float:
    return float(table.numbers(name, default)[row])
