"""Figure: ghosts in the scenes where they are strongest, for docs/ghosts.md."""

from collections.abc import Sequence

import gymnasium as gym
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import testbed.environment.registration  # noqa: F401  (registers the ids)
from sensors.origin import CLUTTER, CONTOUR, DOUBLE, MIRROR, STATIC, VOLUME
from studies.page import DOCS, Docs, Page
from testbed.files import write_figure
from testbed.frame import TRUTH, Frame

RADAR, SCENES, SEED = "surround-ghosts", ("tunnel", "beside-truck", "six-radar-highway"), 0
SCANS = 8  # shown together, each moved with the ego
AHEAD, ASIDE = (-30.0, 75.0), (-20.0, 20.0)  # [m] what is shown around the ego
SHOWN = (  # kinds, label, colour after Okabe and Ito, size
    ((CONTOUR, VOLUME), "vehicles", "#009E73", 5),
    ((STATIC,), "rails and walls", "0.6", 3),
    ((CLUTTER,), "false alarms", "0.8", 3),
    ((MIRROR,), "ghosts in a mirror", "#0072B2", 9),
    ((DOUBLE,), "double reflections", "#D55E00", 9),
)


def main(docs: Docs = DOCS) -> None:
    """Draw the detections of some scans with ghosts and write pictures/ghosts.png."""
    figure = Figure(figsize=(10, 10.5), layout="constrained")
    for axes, scene in zip(figure.subplots(len(SCENES), sharex=True), SCENES, strict=True):
        _draw(axes, frames(scene))
        axes.set_title(f"{scene}, {RADAR}, seed {SEED}, {SCANS} scans", fontsize=9)
        axes.set(aspect="equal", xlim=AHEAD, ylim=ASIDE[::-1], ylabel="to the right [m]")
    axes.set_xlabel("ahead of the ego [m]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=len(SHOWN), fontsize=9)
    write_figure(Page("ghosts", docs).picture("ghosts"), figure, dpi=100)


def frames(scene: str) -> list[Frame]:
    """The first scans of a scene in which the ego does nothing."""
    found: list[Frame] = []
    env = gym.make(f"testbed/{scene}-v0", tracker=TRUTH, radar=RADAR)
    env.get_wrapper_attr("attach")(found.append)
    env.reset(seed=SEED)
    while len(found) < SCANS:
        env.step(1)
    env.close()
    return found[:SCANS]


def _draw(axes: Axes, found: Sequence[Frame]) -> None:
    origin = found[-1].scene.ego.pose[:2]
    for wall in found[-1].scene.walls - origin:
        axes.plot(*wall.T, color="0.75", linewidth=1)
    for outline in (*found[-1].scene.bodies.outline, found[-1].scene.ego.outline):
        axes.fill(*(outline - origin).T, facecolor="0.93", edgecolor="black", linewidth=0.8)
    xy = np.concatenate([frame.scan.xy - frame.scene.ego.pose[:2] for frame in found])
    kind = np.concatenate([frame.origin.kind for frame in found])
    for kinds, label, colour, size in SHOWN:
        x, y = xy[np.isin(kind, kinds)].T
        axes.scatter(x, y, s=size, color=colour, label=label, linewidths=0)
