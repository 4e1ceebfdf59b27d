"""Axes of the figures."""

from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

DECADES = 2.0  # an axis that is shorter has ticks between them


def plain_log(axis: Axis) -> None:
    """Ticks of a logarithmic axis as plain numbers, few enough to be read; call it when the data are drawn."""
    low, high = sorted(axis.get_view_interval())
    short = high / max(low, 1e-12) < 10**DECADES
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if short else (1.0,), numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}" if value < 1e6 else f"{value:.0e}"))
    axis.set_minor_locator(NullLocator())
