"""Figure: the fields of view of every rig, for docs/radars.md."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle, Wedge

from sensors import RADARS, Radar
from sensors.rigs import FLANK, NOSE
from studies.page import DOCS, Docs, Page
from testbed.files import write_figure

ACROSS = 4  # panels in a row
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # after Okabe and Ito


def main(docs: Docs = DOCS) -> None:
    """Draw the fields of view of every rig and write pictures/radars.png."""
    draw(Page("radars", docs).picture("radars"))


def draw(path: Path) -> Path:
    """Write the figure as PNG and return where."""
    rows = -(-len(RADARS) // ACROSS)
    figure = Figure(figsize=(13, 3.5 * rows), layout="constrained")
    panels = figure.subplots(rows, ACROSS, squeeze=False).ravel()
    for axes, radar in zip(panels, RADARS.values(), strict=False):
        _rig(axes, radar)
    for axes in panels[len(RADARS) :]:
        axes.axis("off")
    return write_figure(path, figure, dpi=90)


def _rig(axes: Axes, radar: Radar) -> None:
    """One rig on its car, ahead to the right and the driver's left up, as drivers see a map."""
    for k, sensor in enumerate(radar.sensors):
        x, y, heading = sensor.mount
        middle, half = -np.degrees(heading), sensor.fov_deg / 2  # y of the vehicle is to its right
        colour = COLOURS[k % len(COLOURS)]
        wedge = Wedge((x, -y), sensor.max_range, middle - half, middle + half, facecolor=colour, alpha=0.28)
        axes.add_patch(wedge)
        axes.add_patch(Wedge((x, -y), sensor.max_range, middle - half, middle + half, fill=False, edgecolor=colour))
    axes.add_patch(Rectangle((-NOSE, -FLANK - 0.1), 2 * NOSE, 2 * (FLANK + 0.1), facecolor="black"))
    far = max(sensor.max_range for sensor in radar.sensors) * 1.06
    step = 20 if far < 60 else 50
    ticks = np.arange(-step * (far // step), far, step)
    axes.set(aspect="equal", xlim=(-far, far), ylim=(-far, far), xticks=ticks, yticks=ticks, xlabel="ahead [m]")
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
    axes.set_title(f"{radar.name}: {len(radar.sensors)}", fontsize=10, loc="left")
