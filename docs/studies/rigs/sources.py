"""Where every number of every mounted radar of the catalogue comes from."""

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType

from sensors import Sensor, rigs

LEGEND: Mapping[str, str] = MappingProxyType({
    "W": "of the simulated world in which the multi-object tracker was developed: plausible, of no data sheet",
    "C": "fitted to the cars of Meyer and Kuschk (2019), `testbed calibrate`",
    "S": "compared with the scans of Ding et al. (2022), [standing-returns.md](standing-returns.md)",
    "R": "measured on whole scans of Meyer and Kuschk (2019), `PYTHONPATH=docs python -m studies range-rates`",
    "A": "near scan of the Continental ARS 408-21, the radar of Caesar et al. (2020), as published by the maker",
    "L": "learned from simulated detections of this radar, `python -m studies depth-profiles`",
    "P": "a choice: plausible, no source",
    "I": "by definition: what the rig is for",
    "-": "the default of `Sensor`, a choice",
})  # fmt: skip
SENSORS: Mapping[str, Sensor] = MappingProxyType({
    name: getattr(rigs, name) for name in ("LONG_RANGE", "SIDE", "IMAGING", "ROADSIDE", "NUSCENES", "LIDAR", "IDEAL")
})  # fmt: skip
_WORLD = "max_range fov_deg sigma_range sigma_azimuth_deg sigma_rate count_at_15m count_falloff clutter"
_FITTED = (
    "count_at_15m count_falloff count_max grazing share_volume depth_contour depth_volume share_scatter scatter "
    "sigma_azimuth_deg aspects"
)
_IMAGING = {
    "C": _FITTED,
    "W": "max_range sigma_range",
    "P": "fov_deg spacing_deg clutter",
    "L": "profile",
}
SOURCES: Mapping[str, Mapping[str, str]] = MappingProxyType({  # sensor -> key of the legend -> names of fields
    "LONG_RANGE": {"W": _WORLD, "P": "spacing_deg"},
    "SIDE": {"W": _WORLD, "P": "spacing_deg"},
    "IMAGING": {**_IMAGING, "R": "sigma_rate"},
    "ROADSIDE": {**_IMAGING, "S": "sigma_rate roadside"},
    "NUSCENES": {
        "A": "fov_deg sigma_range sigma_azimuth_deg cell_range cell_azimuth_deg cell_rate",
        "P": "max_range spacing_deg sigma_rate count_at_15m count_falloff clutter",
    },
    "LIDAR": {
        "I": "fov_deg spacing_deg share_volume depth_contour clutter count_shape",
        "P": "max_range sigma_range sigma_azimuth_deg sigma_rate count_at_15m count_falloff count_max static_density "
             "profile",
    },
    "IDEAL": {
        "I": "max_range fov_deg sigma_range sigma_azimuth_deg sigma_rate count_falloff count_shape share_volume "
             "depth_contour clutter static_density",
        "P": "spacing_deg count_at_15m profile",
    },
})  # fmt: skip


def source(sensor: str, name: str) -> str:
    """Key of the legend for a field of a mounted radar; "-" for a default that nothing is said of."""
    return next((key for key, names in SOURCES[sensor].items() if name in names.split()), "-")


def unsourced() -> list[tuple[str, str]]:
    """Sensor and field of every number that is not the default and of which nothing is said."""
    default = Sensor()
    return [
        (sensor, one.name)
        for sensor, value in SENSORS.items()
        for one in fields(Sensor)
        if source(sensor, one.name) == "-" and getattr(value, one.name) != getattr(default, one.name)
    ]
