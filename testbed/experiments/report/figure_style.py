"""Style of the figures of reports: colours, dashes and markers of the trackers, and settings of matplotlib.

Colours are those of Okabe and Ito (2008), "Color Universal Design", without the yellow, which fades on white. Colours,
dashes and markers repeat after 7, 4 and 9 entries, so no two of the first 252 trackers share all three, nor of the
first 28 colour and dash.
"""

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9")
DASHES: tuple[Any, ...] = ("solid", (0, (6, 1.6)), (0, (1.2, 1.4)), (0, (6, 1.6, 1.2, 1.6)))
MARKERS = "osD^vPX*<"
OTHERS = "0.75"  # trackers that stand behind the chosen ones
GOOD, BAD = "#2166AC", "#B35806"  # the ends of the diverging map
DIVERGING = "PuOr"
ONSET, DURING = "0.93", "0.86"  # shades of the phases
LIMITS = "#009E73"
DECADES = 2.0  # a logarithmic axis that is shorter has ticks between them
SIZE = 9  # of all letters
RC: MappingProxyType[Any, Any] = MappingProxyType(
    {
        "font.size": SIZE,
        "axes.titlesize": SIZE,
        "axes.labelsize": SIZE,
        "figure.titlesize": SIZE + 2,
        "figure.labelsize": SIZE,
        "xtick.labelsize": SIZE - 1,
        "ytick.labelsize": SIZE - 1,
        "legend.fontsize": SIZE,
        "legend.frameon": False,
        "legend.handlelength": 3.2,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "0.88",
        "grid.linewidth": 0.6,
        "axes.edgecolor": "0.5",
        "axes.linewidth": 0.7,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "xtick.color": "0.25",
        "ytick.color": "0.25",
        "lines.linewidth": 1.4,
        "lines.markersize": 4.5,
        "figure.facecolor": "white",
        "savefig.dpi": 130,
    }
)


class LineStyle(NamedTuple):
    """How one tracker is drawn."""

    color: str
    linestyle: Any
    marker: str

    @property
    def line(self) -> dict[str, Any]:
        """Keywords of a line without markers."""
        return {"color": self.color, "linestyle": self.linestyle}


def line_styles(trackers: Sequence[str]) -> dict[str, LineStyle]:
    """A style for each; the first ones differ most.

    >>> line_styles(["a", "b"])["b"].color
    '#D55E00'
    """
    return {
        name: LineStyle(COLOURS[k % len(COLOURS)], DASHES[k % len(DASHES)], MARKERS[k % len(MARKERS)])
        for k, name in enumerate(trackers)
    }


def label(tracker: str, study: Any) -> str:
    """A tracker as legends have it: the one that the others are compared with is marked."""
    return f"{tracker} (reference)" if tracker == study.baseline and len(study.trackers) > 1 else tracker


def panels(
    count: int, size: tuple[float, float], margin: tuple[float, float] = (0.0, 0.0), columns: int = 4, **shared: Any
) -> tuple[Figure, list[Axes]]:
    """A figure of small multiples of a size [in] each, and the axes of those that are used, row by row."""
    columns = min(count, columns)
    rows = -(-count // columns)
    figure = Figure(figsize=(columns * size[0] + margin[0], rows * size[1] + margin[1]), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **shared).ravel()
    for axis in axes[count:]:
        axis.set_axis_off()
    return figure, list(axes[:count])


def plain_log(axis: Axis) -> None:
    """Ticks of a logarithmic axis as plain numbers, few enough to be read; call it when the data are drawn."""
    low, high = sorted(axis.get_view_interval())
    short = high / max(low, 1e-12) < 10**DECADES
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if short else (1.0,), numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}" if value < 1e6 else f"{value:.0e}"))
    axis.set_minor_locator(NullLocator())
