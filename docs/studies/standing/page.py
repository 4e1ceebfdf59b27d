"""The page docs/standing-returns.md: what stands still in scans of a real radar and of ours."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from sensors import RADARS, Radar, Roadside
from studies.page import DOCS, Docs, Page, fill, steps
from studies.standing.figure import draw
from studies.standing.scans import DURATION, EVERY, SCENARIOS, SEED, at_speed, drives, read_real, simulate
from studies.standing.statistics import STANDS, STILL, Judged, judge, runs, statistics
from testbed.command_line.terminal import user_input
from testbed.log.text import markdown_table

OFF, ON, ON_ROAD = "imaging", "imaging-roadside", 0.015
COMMAND = "PYTHONPATH=docs python -m studies standing-returns DATA --docs docs"  # DATA lies elsewhere on every machine


def main(
    data: Annotated[Path, typer.Argument(help="The folder with frames.npz of the real radar.")],
    docs: Docs = DOCS,
) -> None:
    """Write the page "What stands still" from scans of a real radar and simulated ones."""
    with user_input():
        scans, frames = read_real(data)
        real = [judge(scan) for scan in scans]
        page = Page("standing-returns", docs)
    moving = [one for one in real if one.speed > STANDS]
    speed = float(np.mean([one.speed for one in moving]))
    rigs = {name: RADARS[name] for name in (OFF, ON)}
    rigs["with points on the road"] = on_road(RADARS[ON])
    others = [name for name in RADARS if name not in rigs]
    simulated: dict[str, list[Judged]] = {}
    with steps(1 + len(rigs) + len(others)) as step:
        step("drives")
        scenes = [(name, at_speed(scene, speed)) for name, found in drives() for scene in found]
        for name, radar in {**rigs, **{name: RADARS[name] for name in others}}.items():
            step(name)
            simulated[name] = [judge(scan) for scan in simulate(radar, scenes) if len(scan.polar) > 1]
    draw({"real, moving": moving, OFF: simulated[OFF], ON: simulated[ON]}, page.picture("standing-returns"))
    groups = {"real, moving": moving, "real, standing": [one for one in real if one.speed <= STANDS]}
    groups |= {name: simulated[name] for name in rigs}
    text = fill(
        "standing/page.md.j2",
        scans=len(real), runs=len(runs(real)), frames=frames, repeated=frames - len(real),
        slowest=min(one.speed for one in moving), fastest=max(one.speed for one in moving), still=STILL,
        scenarios=", ".join(f"`{name}`" for name in SCENARIOS), duration=DURATION, seed=SEED, every=EVERY,
    )  # fmt: skip
    page.write("\n\n".join([text, compared(groups), by_drive(real, simulated[ON]), by_rig(simulated)]), COMMAND)


def on_road(radar: Radar) -> Radar:
    """The rig with points on the road too."""
    return replace(radar, sensors=(replace(radar.sensors[0], roadside=Roadside(on_road=ON_ROAD)),))


def compared(groups: dict[str, list[Judged]]) -> str:
    """All statistics, a column for each group of scans."""
    found = {name: statistics(judged) for name, judged in groups.items()}
    rows = [
        (label, *(number(label, column[label]) for column in found.values())) for label in next(iter(found.values()))
    ]
    return (
        f"## Real and simulated\n\nCounts are means a scan; with points on the road: {ON_ROAD:g} a square metre.\n\n"
        + (markdown_table(("", *found), rows))
    )


def number(label: str, value: float) -> str:
    """A statistic in words; a dash where there is nothing to judge."""
    if np.isnan(value):
        return "–"
    if "share" in label:
        return f"{value:.1%}"
    return f"{value:.0f}" if label == "scans" else f"{value:.3f}" if "rest" in label else f"{value:.1f}"


def by_drive(real: list[Judged], simulated: list[Judged]) -> str:
    """How much drives differ: the real ones, moving or not, and the simulated scenarios."""
    head = ("drive", "scans", "speed [m/s]", "standing a scan", "share", "rest, middle [m/s]", "beyond 0.2 m/s")
    labels = ("scans", "ego speed [m/s]", "standing a scan", "standing, share", "rest, middle [m/s]",
              "rest beyond 0.2 m/s, share")  # fmt: skip
    rows = []
    for name, judged in {**runs(real), **runs(simulated)}.items():
        found = statistics(judged)
        rows.append((name, *(number(label, found[label]) for label in labels)))
    return f"## By drive\n\nThe real drives, then the scenarios seen by `{ON}`.\n\n{markdown_table(head, rows)}"


def by_rig(simulated: dict[str, list[Judged]]) -> str:
    """How many detections of what stands the first radar of each rig has."""
    head = ("rig", "detections a scan", "standing a scan", "share", "ego motion found")
    labels = ("detections a scan", "standing a scan", "standing, share", "ego motion found, share of scans")
    rows = []
    for name in RADARS:
        found = statistics(simulated[name])
        rows.append((f"`{name}`", *(number(label, found[label]) for label in labels)))
    return f"## By rig\n\nThe first radar of each.\n\n{markdown_table(head, rows)}"
