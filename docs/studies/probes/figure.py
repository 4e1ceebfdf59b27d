"""Figure of a probe: the road about the most dangerous moment, and the drive over time."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.lanes import LaneShape, is_dashed, is_drawn
from sensors.scene import Scene
from testbed.evaluation.driving import LONGEST, DriveCurves
from testbed.files import write_figure

BEHIND, AHEAD = 25.0, 95.0  # [m] of the road that is shown
EGO, OTHER, SURFACE = "#d04a35", "#c9ccd1", "#f4f4f2"


APART = 1.5  # [s] between the roads that are shown


def draw(scenes: Sequence[Scene], curves: DriveCurves, lanes: Sequence[LaneShape], path: Path) -> None:
    """Write the picture of one drive, whose scenes and curves are frame by frame."""
    danger = np.minimum(curves.ttc, curves.ttc_plane)
    worst = curves.time[int(danger.argmin())] if np.isfinite(danger).any() else curves.time.mean()
    times = [worst - APART, worst, worst + APART]
    figure = Figure(figsize=(9, 6.4), layout="constrained")
    *roads, below = figure.subplots(4, height_ratios=(1, 1, 1, 1.5))
    for axes, time in zip(roads, times, strict=True):
        scene = min(scenes, key=lambda scene: abs(scene.time - time))
        _road(axes, scene, lanes)
        axes.set_title(f"{scene.time:.1f} s", loc="left", fontsize=8, pad=2)
    _curves(below, curves)
    for time in times:
        below.axvline(time, color="0.8", linewidth=0.8, zorder=0)
    write_figure(path, figure, dpi=100)


def _road(axes: Axes, scene: Scene, lanes: Sequence[LaneShape]) -> None:
    x = scene.ego.pose[0]
    for lane in lanes:
        left, right = lane.borders
        axes.fill(*np.concatenate([left, right[::-1]]).T, color=SURFACE, zorder=0)
        for line, kind in zip(lane.borders, lane.lines, strict=True):
            if is_drawn(kind):
                axes.plot(*line.T, color="0.6", linewidth=0.8, dashes=(6, 9) if is_dashed(kind) else (1, 0), zorder=1)
    for outline in scene.bodies.outline:
        axes.fill(*outline.T, facecolor=OTHER, edgecolor="0.2", linewidth=0.8, zorder=2)
    axes.fill(*scene.ego.outline.T, facecolor=EGO, edgecolor="0.2", linewidth=0.8, zorder=3)
    sides = np.concatenate([line[:, 1] for lane in lanes for line in lane.borders])
    # y points to the driver's right
    axes.set(xlim=(x - BEHIND, x + AHEAD), ylim=(min(sides.max(), 12.0) + 0.5, sides.min() - 0.5), aspect="equal")
    axes.axis("off")


def _curves(axes: Axes, curves: DriveCurves) -> None:
    axes.plot(curves.time, curves.speed, color="black", label="speed [m/s]")
    axes.plot(curves.time, curves.braking, color=EGO, label="braking [m/s²]")
    ttc = np.minimum(curves.ttc, LONGEST)
    axes.plot(curves.time, np.where(ttc < LONGEST, ttc, np.nan), color="#3465a4", label="time to collision [s]")
    axes.set(xlabel="time [s]", xlim=(0, curves.time[-1]), ylim=(0, None))
    axes.legend(fontsize=8, ncols=3, loc="upper right")
    axes.spines[["top", "right"]].set_visible(False)
