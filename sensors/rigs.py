"""RADARS: the catalogue of mounted radars, on a car of 4.7 x 1.9 m whose centre is the origin.

        -120 deg   -60 deg
         .------------.
    180  |     o-->   |  0 deg     x forward; drawn as highway-env does, y downwards
         '------------'
        +120 deg   +60 deg

Mounts: bumpers at x = +-2.35 m, side radars at the corners of the body.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from sensors.aspects import Aspects
from sensors.ghosts import Ghosts
from sensors.radar import Radar, Sensor, numeric
from sensors.radar_file import read_radar
from sensors.roadside import Roadside
from trackers.lookup import check_types, entry_of, look_up, parse, with_parameters
from trackers.scan import DepthProfile
from trackers.toml_file import SUFFIX

NOSE, FLANK = 2.35, 0.85  # [m] of the mounts from the centre of the car


def facing(sensor: Sensor, x: float, y: float, heading_deg: float) -> Sensor:
    """The same radar mounted elsewhere."""
    return replace(sensor, mount=(x, y, float(np.radians(heading_deg))))


# Detections of the outline alone: their error is that no outline is a box, which is the same in each scan.
OUTLINE = DepthProfile(
    inside=0.02, depth=0.1, depth_std=0.07, surface_std=0.1, weight=0.35, rounding=(0.1, 0.08),
    rounding_std=(0.1, 0.05), least_room=(0.5, 0.1), hides_within=0.0105,
)  # fmt: skip

# Many detections of the inside, few of them deep: learned from the imaging radar, docs/results/profiles.json.
# They crowd where a vehicle reflects, at its ends and wheels: a stretch without any is no gap between two vehicles.
SHALLOW = DepthProfile(
    inside=0.333, inside_depth=1.3, depth=0.153, depth_std=0.17, grazing=0.0, surface_std=0.0795, patchy=True
)  # fmt: skip

LONG_RANGE = Sensor(
    max_range=174.0, fov_deg=20.0, spacing_deg=0.05, sigma_range=0.25, sigma_azimuth_deg=0.5, sigma_rate=0.10,
    count_at_15m=9.0, count_falloff=0.85, clutter=3.0,
)  # fmt: skip
SIDE = Sensor(
    max_range=30.0, fov_deg=90.0, spacing_deg=0.25, sigma_range=0.15, sigma_azimuth_deg=1.2, sigma_rate=0.12,
    count_at_15m=7.0, count_falloff=0.6, clutter=1.5,
)  # fmt: skip
# Counts, shares, depths and aspects are fitted to real cars, see docs/calibration.md: `testbed calibrate`. The noise of
# range rates is that of the same real radar, docs/radars.md.
IMAGING = Sensor(
    max_range=100.0, fov_deg=110.0, spacing_deg=0.1, sigma_range=0.12, sigma_azimuth_deg=0.32, sigma_rate=0.08,
    count_at_15m=86.0, count_falloff=0.75, count_max=75.0, clutter=8.0, grazing=0.0, share_volume=0.43,
    depth_contour=0.18, depth_volume=0.74, share_scatter=0.46, scatter=0.2, profile=SHALLOW,
    aspects=Aspects(
        count_max=(68.0, 84.0, 57.0), count_shape=(3.9, 2.1, 6.2), hidden=0.12, height=1.6, specular=0.58, plate=1.0,
        under=(0.06, 0.11, 0.25), fade=145.0, wheel_overhang=0.82, wheel_spread=0.15,
    ),
)  # fmt: skip
# What stands beside guard rails, and the noise of range rates, of a real radar: docs/standing-returns.md.
ROADSIDE = replace(IMAGING, sigma_rate=0.03, roadside=Roadside())
NUSCENES = Sensor(
    max_range=100.0, fov_deg=120.0, spacing_deg=0.2, sigma_range=0.1, sigma_azimuth_deg=1.0, sigma_rate=0.1,
    count_at_15m=3.0, count_falloff=0.5, clutter=4.0, cell_range=0.4, cell_azimuth_deg=3.2, cell_rate=0.1,
)  # fmt: skip
LIDAR = Sensor(
    max_range=100.0, fov_deg=360.0, spacing_deg=1.0, sigma_range=0.03, sigma_azimuth_deg=0.05, sigma_rate=0.3,
    count_at_15m=12.0, count_falloff=1.0, count_max=100.0, count_shape=np.inf, share_volume=0.0,
    depth_contour=0.0, clutter=0.0, static_density=0.5, profile=OUTLINE,
)  # fmt: skip
IDEAL = Sensor(
    max_range=150.0, fov_deg=360.0, spacing_deg=0.1, sigma_range=0.0, sigma_azimuth_deg=0.0, sigma_rate=0.0,
    count_at_15m=20.0, count_falloff=0.0, count_shape=0.0, share_volume=0.0, depth_contour=0.0, clutter=0.0,
    static_density=0.0, profile=replace(OUTLINE, hides_within=0.0035),
)  # fmt: skip

SIDES = tuple(
    facing(SIDE, x, y, heading)
    for x, y, heading in ((1.9, FLANK, 60.0), (1.9, -FLANK, -60.0), (-1.9, FLANK, 120.0), (-1.9, -FLANK, -120.0))
)
FRONT, REAR = facing(LONG_RANGE, NOSE, 0.0, 0.0), facing(LONG_RANGE, -NOSE, 0.0, 180.0)

RADARS = MappingProxyType({r.name: r for r in (
    Radar("front", "one long-range radar ahead, 174 m x 20 deg; figures of the tracking study's world", (FRONT,)),
    Radar("corners", "four side radars, 30 m x 90 deg at +-60 and +-120 deg; figures as for front", SIDES),
    Radar("surround", "front and rear long range, four side radars: the six-radar car; figures as for front",
          (FRONT, REAR, *SIDES)),
    Radar("surround-ghosts", "surround with ghosts in rails and trucks, and between leader and ego; shares are ours",
          (FRONT, REAR, *SIDES), ghosts=Ghosts()),
    Radar("nuscenes-like", "five radars at 13 Hz, sparse and merged; rate and places after Caesar et al. (2020)", (
        facing(NUSCENES, NOSE, 0.0, 0.0),
        facing(NUSCENES, 1.9, FLANK, 55.0), facing(NUSCENES, 1.9, -FLANK, -55.0),
        facing(NUSCENES, -NOSE, FLANK, 170.0), facing(NUSCENES, -NOSE, -FLANK, -170.0)), rate=13.0),
    Radar("imaging", "high-resolution front radar, 100 m x 110 deg; calibrated on Meyer and Kuschk (2019)",
          (facing(IMAGING, NOSE, 0.0, 0.0),)),
    Radar("imaging-roadside", "imaging with what stands beside guard rails, fitted to scans of Ding et al. (2022)",
          (facing(ROADSIDE, NOSE, 0.0, 0.0),)),
    Radar("lidar-1deg", "a ray each degree, contour only, nearly without noise: the upper bound of a sensor",
          (LIDAR,)),
    Radar("ideal", "for tests: no noise, no clutter, every object in sight, fixed counts, contour only", (IDEAL,)),
)})  # fmt: skip


def staggered(radar: Radar, rate: float) -> Radar:
    """The rig with sensors that measure one after another, each `rate` times a second; frames are to be short enough.

    With S sensors, a simulation of S times that rate has one sensor in each scan, and so a time stamp for each.
    """
    number = len(radar.sensors)
    return replace(radar, sensors=tuple(replace(s, rate=rate, phase=k / number) for k, s in enumerate(radar.sensors)))


def find(name: str) -> Radar:
    """The radar rig of that name: `NAME`, `NAME:key=value,key=value`, `MODULE:OBJECT:...` or a file `PATH.toml`.

    Of a `Radar` the keys are its fields, and those of `Sensor`, which then hold for all its sensors.

    Raises:
        LookupError: no such radar; the nearest name is suggested.
        ValueError: a parameter or value that it cannot have, or an OBJECT that is no radar.
    """
    if not isinstance(name, str):
        return look_up(name, RADARS, "radar")
    entry, values = parse(name)
    radar: Any = read_radar(entry) if entry.endswith(SUFFIX) else entry_of(entry, RADARS, "radar")
    radar = _varied(radar, name, entry, values) if isinstance(radar, Radar) else with_parameters(radar, entry, values)
    if missing := [part for part in ("models", "rate", "scan") if not hasattr(radar, part)]:
        raise ValueError(f"radar {name!r} is {radar!r}, which has no {', '.join(missing)}; make it a `sensors.Radar`")
    return radar


def _varied(radar: Radar, text: str, entry: str, values: Mapping[str, Any]) -> Radar:
    """The rig with other numbers, of all its sensors those that a `Sensor` has; ValueError for unknown ones."""
    if not values:
        return radar
    own = [one.name for one in fields(Radar) if one.name not in ("name", "note", "sensors")]
    inner = [key for key in numeric() if key not in (*own, "mount")]
    if unknown := sorted(values.keys() - {*own, *inner}):
        raise ValueError(f"{entry} has no parameter {', '.join(unknown)}; it has {', '.join([*own, *inner])}")
    check_types(radar.sensors[0], entry, given := {key: value for key, value in values.items() if key in inner})
    sensors = tuple(replace(sensor, **given) for sensor in radar.sensors)
    rest = {key: value for key, value in values.items() if key in own}
    return replace(with_parameters(radar, entry, rest), name=text, sensors=sensors)
