"""Figure: length error of each tracker against the visible share of the vehicle, short and long vehicles apart."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from studies.closed_loop.length_errors import LengthSamples, profile
from testbed.experiments.series import LABELS
from testbed.files import write_figure
from trackers.htg.bins import TRUCK_ABOVE

COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "0.45")  # after Okabe and Ito
MARKERS = "os^vDPX*<"
STROKES = ("-", "--", ":")  # of the first round of colours, the second and the third
QUANTITIES = {
    "mean": "mean length error [m]",
    "rms": "RMS length error [m]",
    "held": "frames with a track that fits [%]",
}


def draw(samples: Mapping[str, LengthSamples], path: Path) -> Path:
    """Write the figure as PNG and return where; one line a tracker, in the order given."""
    figure = Figure(figsize=(9, 8), layout="constrained")
    panels = figure.subplots(len(QUANTITIES), 2, sharex="col")
    for j, title in enumerate((f"up to {TRUCK_ABOVE} m long", f"over {TRUCK_ABOVE} m long")):
        for k, (name, both) in enumerate(samples.items()):
            chosen = (both.length > TRUCK_ABOVE) == bool(j)
            found = profile(LengthSamples(*(values[chosen] for values in both)))
            style = {"color": COLOURS[k % len(COLOURS)], "marker": MARKERS[k % len(MARKERS)]}
            style["linestyle"] = STROKES[k // len(COLOURS) % len(STROKES)]
            for axis, quantity in zip(panels[:, j], QUANTITIES, strict=True):
                scale = 100 if quantity == "held" else 1
                axis.plot(scale * getattr(found, quantity), label=name, linewidth=1.3, markersize=5, **style)
        panels[0, j].set_title(title)
        ticks = [f"{label}\n{n}" for label, n in zip(LABELS, found.frames, strict=True)]
        panels[-1, j].set_xticks(np.arange(len(LABELS)), ticks)
        panels[-1, j].set(
            xlabel="visible share, and the number of frames", xlim=(-0.3, len(LABELS) - 0.7), ylim=(0, 103)
        )
        panels[0, j].axhline(0, color="black", linewidth=0.8, linestyle=":")
        panels[1, j].set_ylim(bottom=0)
    for row, label in zip(panels, QUANTITIES.values(), strict=True):
        row[0].set_ylabel(label)
        for axis in row:
            axis.grid(alpha=0.3)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(7, len(labels)), fontsize=8)
    return write_figure(path, figure, dpi=90)
