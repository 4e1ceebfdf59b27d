"""The page docs/radars.md: every number of every rig with its source, and what other ones would change."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensors import RADARS, Radar, Sensor, Surroundings
from studies.rigs.sensitivity import RIG
from studies.rigs.sources import LEGEND, SENSORS, source
from testbed.evaluation.intervals import student_interval
from testbed.log.text import markdown_table

TEXT = """# Radars and their sources

Written by `make generated` from [sensors/rigs.py](../sensors/rigs.py), from the sources named in
[sources.py](studies/rigs/sources.py) and from the results [surround.json](results/surround.json) and
[range-rates.json](results/range-rates.json); do not edit it by hand. How a radar detects: [radar.md](methods/radar.md),
where the symbols and equations of each field are.

![fields of view of every rig](pictures/radars.png)

Each panel has a scale of its own; ahead is to the right, left is up. The number is that of the mounted radars.

## Rigs

{rigs}

Ghosts ([ghosts.md](ghosts.md)) are off by default: only `surround-ghosts` has them, any other rig with
`replace(rig, ghosts=Ghosts())`.

Mounts are choices: bumpers and corners of a car of 4.7 x 1.9 m. The directions of `surround` and `corners` are those
of the world W below. `nuscenes-like` has the number of radars, the places by name (ahead, front corners, rear corners)
and the rate of Caesar et al. (2020); its directions are choices, as there the front corners look to the side, at 88 and
-91 deg, and the rear ones at 174 and -176.

## Every number

The letter behind a number says where it comes from:

{legend}

{numbers}

`surroundings` of `ROADSIDE`: {surroundings}.

What the maker publishes of A: field of view ±60 deg; accuracy 0.1 m in range, and in azimuth 0.3 deg ahead, 1 at 45 and
5 at 60; resolution 0.39 m and, in range rate, 0.37 to 0.43 km/h, about 0.1 m/s. These were read in a transcription of
the data sheet, which does not have the 3.2 deg of `cell_azimuth_deg`: that one is not confirmed. `sigma_rate` is a
choice: the maker's accuracy is 0.1 km/h, 0.03 m/s.

## Does `imaging` keep its range rates?

The radar that it is fitted to reports range rates in {steps} steps of {step:g} m/s. Ego motion explains those of the
standing detections in its {scans} whole scans with a spread (1.4826 times the middle of the absolute rest, {standing}
of {detections} detections within 0.5 m/s) of {spread:g} m/s; half of the scans have {spread_low:g} to {spread_high:g}.
The same statistic of `imaging`, with 0.08 m/s, is 0.084 ([standing-returns.md](standing-returns.md)), so it keeps them.
The radar of Ding et al. (2022) is another one, with 0.036 m/s while it moves and 0.003 at rest; `imaging-roadside`,
which is compared with that, has 0.03.

## Does `surround` keep its figures?

They are of no sensor. What that means for results is measured: the default tracker, `{tracker}`, on {scenarios}, seeds
{seeds}, {duration:g} s each, on the same drives with one group of figures changed for all six radars. Differences to
the rig as it is, with 95 % intervals over {units} drives; bold where the interval excludes zero.

{sensitivity}

{verdict}
"""
VERDICT = """
It keeps them. Better range rates, azimuths twice as good and no false alarms at all move GOSPA by less than these
drives resolve, so a source for those figures would hardly change a comparison. What counts is how many detections a
vehicle gives: 7 and 9 at 15 m here, 86 of `imaging`, which is fitted to real cars, 3 of `nuscenes-like`, which is a
choice. A real radar of this kind, with boxes around what it sees, would decide; none is at hand, and to take over the
figures of `imaging` would make another rig of it. Surroundings beside the road change nothing that is resolved, so they
stay off in all rigs but `imaging-roadside`. Points on the road itself (`on_road`) do: the tracker reports what stands
there, false tracks for the metrics, obstacles for a planner. They are off everywhere.
"""
LABELS = {
    "gospa": "GOSPA [m]", "missed_percent": "missed [%]", "false_per_scan": "false a scan",
    "rmse_position": "position [m]", "rmse_velocity": "velocity [m/s]", "abs_length": "length [m]",
}  # fmt: skip


def text(docs: Path) -> str:
    """The page, from the code and the committed results under `docs`."""
    results = json.loads((docs / "results" / f"{RIG}.json").read_text())
    values = {f.name: getattr(Surroundings(), f.name) for f in fields(Surroundings)}
    return TEXT.format(
        rigs=markdown_table(
            ("name", "radars", "what", "mounts x, y [m], heading [deg]"),
            [(f"`{r.name}`", str(len(r.sensors)), r.note, "; ".join(mounts(r))) for r in RADARS.values()],
        ),
        legend="\n".join(f"- **{key}** {what}" for key, what in LEGEND.items() if key != "-")
        + f"\n- no letter: {LEGEND['-']}",
        numbers=markdown_table(
            ("field", *(f"`{name}`" for name in SENSORS)),
            [(f"`{f.name}`", *(cell(name, f.name) for name in SENSORS)) for f in fields(Sensor) if f.name != "mount"],
        ),
        **json.loads((docs / "results" / "range-rates.json").read_text()),
        surroundings=", ".join(f"`{name}` {value:g}" for name, value in values.items()),
        tracker=results["tracker"],
        scenarios=", ".join(f"`{name}`" for name in results["scenarios"]),
        seeds=", ".join(map(str, results["seeds"])),
        duration=results["duration"],
        units=len(results["scenarios"]) * len(results["seeds"]),
        sensitivity=sensitivity(results["rows"]),
        verdict=VERDICT.strip(),
    )


def mounts(radar: Radar) -> list[str]:
    """Where each radar of a rig sits, in words."""
    return [f"{x:g}, {y:g}, {np.degrees(a):g}" for x, y, a in (sensor.mount for sensor in radar.sensors)]


def cell(sensor: str, name: str) -> str:
    """A number and the letter of its source."""
    value, key = getattr(SENSORS[sensor], name), source(sensor, name)
    shown = f"{value:g}" if isinstance(value, float | int) else "off" if value is None else "see there"
    return shown if key == "-" else f"{shown} {key}"


def sensitivity(rows: dict[str, list[dict[str, Any]]]) -> str:
    """The rig as it is, and differences to it for every change, a column a measure."""
    base, *others = rows
    columns = {name: {m: np.array([row[m] for row in found]) for m in LABELS} for name, found in rows.items()}
    body = [(base, *(f"{columns[base][m].mean():.2f}" for m in LABELS))]
    for name in others:
        differences = (columns[name][m] - columns[base][m] for m in LABELS)
        body.append((name, *(difference(d) for d in differences)))
    return markdown_table(("", *LABELS.values()), body)


def difference(values: NDArray) -> str:
    """Mean of differences, one a drive, with its interval by Student's t."""
    mean, half = student_interval(values)
    shown = f"{mean:+.2f} ± {half:.2f}"
    return f"**{shown}**" if abs(mean) > half else shown
