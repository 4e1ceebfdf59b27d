"""The page docs/radars.md: every number of every rig with its source, and what other ones would change."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensors import RADARS, Radar, Roadside, Sensor
from studies.page import fill
from studies.rigs.sensitivity import MEASURES, RIG
from studies.rigs.sources import LEGEND, SENSORS, source
from testbed.evaluation.intervals import student_interval
from testbed.evaluation.metric import METRICS
from testbed.log.text import markdown_table


def text(docs: Path) -> str:
    """The page, from the code and the committed results under `docs`."""
    results = json.loads((docs / "results" / f"{RIG}.json").read_text())
    names = [f.name for f in fields(Sensor) if f.name != "mount"]
    own = {name for name in names if any(source(sensor, name) != "-" for sensor in SENSORS)}  # of some sensor
    values = {f.name: getattr(Roadside(), f.name) for f in fields(Roadside)}
    return fill(
        "rigs/page.md.j2",
        rigs=markdown_table(
            ("name", "radars", "what", "mounts x, y [m], heading [deg]"),
            [(f"`{r.name}`", str(len(r.sensors)), r.note, mounts(r)) for r in RADARS.values()],
        ),
        legend="\n".join(f"- **{key}** {what}" for key, what in LEGEND.items() if key != "-")
        + f"\n- no letter: {LEGEND['-']}",
        numbers=markdown_table(
            ("field", *(f"`{name}`" for name in SENSORS)),
            [(f"`{name}`", *(cell(sensor, name) for sensor in SENSORS)) for name in names if name in own],
        ),
        defaults=", ".join(f"`{name}` {cell(next(iter(SENSORS)), name)}" for name in names if name not in own),
        **json.loads((docs / "results" / "range-rates.json").read_text()),
        roadside=", ".join(f"`{name}` {value:g}" for name, value in values.items()),
        tracker=results["tracker"],
        scenarios=", ".join(f"`{name}`" for name in results["scenarios"]),
        seeds=", ".join(map(str, results["seeds"])),
        duration=results["duration"],
        units=len(results["scenarios"]) * len(results["seeds"]),
        sensitivity=sensitivity(results["rows"]),
    )


def mounts(radar: Radar) -> str:
    """Where each radar of a rig sits, or which earlier rig of several radars has the same mounts."""
    own = [sensor.mount for sensor in radar.sensors]
    first = next(r for r in (*RADARS.values(), radar) if [sensor.mount for sensor in r.sensors] == own)
    if first is not radar and len(own) > 1:
        return f"as `{first.name}`"
    return "; ".join(f"{x:g}, {y:g}, {np.degrees(a):g}" for x, y, a in own)


def cell(sensor: str, name: str) -> str:
    """A number and the letter of its source."""
    value, key = getattr(SENSORS[sensor], name), source(sensor, name)
    shown = f"{value:g}" if isinstance(value, float | int) else "off" if value is None else "see there"
    return shown if key == "-" else f"{shown} {key}"


def sensitivity(rows: dict[str, list[dict[str, Any]]]) -> str:
    """The rig as it is, and differences to it for every change, a column a measure."""
    base, *others = rows
    columns = {name: {m: np.array([row[m] for row in found]) for m in MEASURES} for name, found in rows.items()}
    body = [(base, *(f"{columns[base][m].mean():.2f}" for m in MEASURES))]
    for name in others:
        differences = (columns[name][m] - columns[base][m] for m in MEASURES)
        body.append((name, *(difference(d) for d in differences)))
    return markdown_table(("", *(METRICS[m].title for m in MEASURES)), body)


def difference(values: NDArray) -> str:
    """Mean of differences, one a drive, with its interval by Student's t."""
    mean, half = student_interval(values)
    shown = f"{mean:+.2f} ± {half:.2f}"
    return f"**{shown}**" if abs(mean) > half else shown
