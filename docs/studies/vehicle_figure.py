"""Figure: vehicles of each class as they are drawn for the scenarios, for docs/methods/vehicles.md."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from scenarios.articulated import KINGPIN, OVERHANG, TRAILER, UNIT
from scenarios.contours import CONTOURS
from studies.page import DOCS, Docs, Page
from testbed.files import write_figure

PANELS = (("motorcycle", "car", "van", "tractor"), ("truck", "bus", "articulated"))  # each drawn to its own scale
WIDE = (58.0, 116.0)  # [m] across each panel
DRAWS = 200  # vehicles of a class, of which the shortest, the quartiles and the longest are shown
SPACE = 2.0  # [m] between vehicles


def main(docs: Docs = DOCS) -> None:
    """Draw vehicles of each class and write pictures/vehicles.png."""
    rng = np.random.default_rng(0)
    figure = Figure(figsize=(12, 5.6), layout="constrained")
    for axes, kinds, wide in zip(figure.subplots(2, height_ratios=(1.5, 1)), PANELS, WIDE, strict=True):
        pitch = 0.06 * wide  # [m] from class to class
        for row, kind in enumerate(kinds):
            axes.text(-0.01 * wide, -pitch * row, kind, ha="right", va="center", fontsize=9)
            _row(axes, [bodies(kind, size) for size in sizes(kind, rng)], -pitch * row, 0.5 * pitch)
        axes.set(aspect="equal", xlim=(-0.09 * wide, 0.96 * wide), ylim=(-pitch * (len(kinds) - 0.4), 0.5 * pitch))
        axes.axis("off")
    write_figure(Page("vehicles", docs).picture("vehicles"), figure, dpi=110)


def sizes(kind: str, rng: np.random.Generator) -> list[NDArray]:
    """The default size (2,) [m] of a class, then the shortest, the quartiles and the longest of many vehicles."""
    contour = CONTOURS[TRAILER if kind == "articulated" else kind]
    if contour.sizes is None:
        return [contour.size]
    drawn = sorted((contour.sizes.draw(rng) for _ in range(DRAWS)), key=lambda size: float(size[0]))
    return [contour.size, *(drawn[k] for k in np.linspace(0, DRAWS - 1, 5).astype(int))]


def bodies(kind: str, size: NDArray) -> list[NDArray]:
    """Outlines (C, 2) [m] of one vehicle in line; `size` (2,) [m] is that of the trailer of an articulated truck."""
    if kind != "articulated":
        return [CONTOURS[kind].fit(size)]
    unit = CONTOURS[UNIT]
    back = np.array([KINGPIN + OVERHANG - size[0] / 2, 0.0])
    return [unit.fit(unit.size), CONTOURS[TRAILER].fit(size) + back]


def _row(axes: Axes, vehicles: list[list[NDArray]], y: float, below: float) -> None:
    x = 0.0
    for k, outlines in enumerate(vehicles):
        rear = min(outline[:, 0].min() for outline in outlines)
        length = max(outline[:, 0].max() for outline in outlines) - rear
        for outline in outlines:
            line = 0.8 if k else 1.8
            axes.fill(outline[:, 0] - rear + x, outline[:, 1] + y, facecolor="0.9", edgecolor="black", linewidth=line)
        axes.text(x + length / 2, y - below, f"{length:.1f} m", ha="center", va="center", fontsize=7, color="0.3")
        x += length + SPACE
