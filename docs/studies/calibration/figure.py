"""Figure: where real and simulated detections lie on cars, in the unit frame, a column for each side that they show."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studies.calibration.statistics import ASPECTS, Vehicles
from testbed.files import write_figure
from trackers.geometry import to_frame

EDGE = 1.3  # of the panels, in unit coordinates
CELLS = 52  # along each axis
BRIGHTEST = 1.6  # density of the detections, per unit area, that the colours end with


def unit_frame(vehicles: Vehicles) -> NDArray:
    """Unit coordinates (M, 2) of all detections, mirrored so that the radar is to the left of every vehicle."""
    pose = vehicles.pose[vehicles.row]
    u = 2 * to_frame(pose, vehicles.xy[:, None])[:, 0] / vehicles.size[vehicles.row]
    radar = to_frame(pose, np.zeros((len(pose), 1, 2)))[:, 0, 1]
    return u * np.stack([np.ones(len(u)), np.where(radar < 0, -1.0, 1.0)], -1)


def density(u: NDArray) -> NDArray:
    """Detections a unit area (CELLS, CELLS) of u (M, 2), as shares of all."""
    count = np.histogram2d(u[:, 0], u[:, 1], CELLS, ((-EDGE, EDGE), (-EDGE, EDGE)))[0]
    return count / (max(count.sum(), 1.0) * (2 * EDGE / CELLS) ** 2)


def draw(shown: Mapping[str, Vehicles], path: Path) -> Path:
    """Write the figure as PNG and return where: a row for each set of vehicles, by its title; cars only."""
    figure = Figure(figsize=(13.0, 2.9 * len(shown)), layout="constrained")
    panels = figure.subplots(len(shown), len(ASPECTS), squeeze=False)
    for row, (title, vehicles) in zip(panels, shown.items(), strict=True):
        u, cars = unit_frame(vehicles), vehicles.kind == "car"
        for k, (axis, aspect) in enumerate(zip(row, ASPECTS, strict=True)):
            chosen = (cars & (vehicles.aspect == k))[vehicles.row]
            axis.imshow(
                np.sqrt(density(u[chosen])).T, origin="lower", extent=(-EDGE, EDGE, -EDGE, EDGE), cmap="viridis",
                vmin=0.0, vmax=np.sqrt(BRIGHTEST),
            )  # fmt: skip
            axis.plot([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1], color="white", linewidth=0.7)
            axis.set_title(f"{title}: {aspect}", fontsize=9)
            axis.tick_params(labelsize=7)
    figure.supxlabel("along the car, its front to the right; the radar is above, the box is drawn in white", fontsize=9)
    return write_figure(path, figure, dpi=100)
