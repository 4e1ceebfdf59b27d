"""Figure: the contours that a tracker has learned of vehicles that are passed, at some moments."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from studies.contours.passing import PassedTrack
from testbed.files import write_figure

TRUTH, KNOWN = "0.45", "#0072B2"  # after Okabe and Ito


def draw(tracks: Mapping[str, PassedTrack], moments: Sequence[float], path: Path) -> Path:
    """Write the figure as PNG and return where: a row for each vehicle, a column for each moment [s]."""
    figure = Figure(figsize=(4.2 * len(moments), 1.9 * len(tracks)), layout="constrained")
    panels = figure.subplots(len(tracks), len(moments), squeeze=False)
    for row, (kind, found) in zip(panels, tracks.items(), strict=True):
        half = np.abs(np.concatenate(found.truth)).max(0) + np.array([0.8, 0.6])
        for axis, moment in zip(row, moments, strict=True):
            k = min(int(np.searchsorted(found.time, moment - 1e-9)), len(found.time) - 1)
            for outline in found.truth:
                axis.fill(*outline.T, facecolor="0.92", edgecolor=TRUTH, linewidth=1.0)
            ring = np.concatenate([found.contour[k], found.contour[k, :1]])
            axis.plot(*ring.T, color=KNOWN, linewidth=1.8)
            changes = sum(time <= moment for time, _ in found.events)
            axis.set_title(f"{kind}, {moment:g} s: IoU {found.iou[k]:.2f}, learned {changes} times", fontsize=9)
            axis.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), aspect="equal")
            axis.tick_params(labelsize=7)
    figure.supxlabel("along the vehicle [m]; grey: truth, blue: the track's contour in its own frame", fontsize=9)
    return write_figure(path, figure, dpi=100)
