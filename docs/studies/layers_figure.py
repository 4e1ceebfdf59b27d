"""Figures: one moment of a drive, truth and tracks of a filter alone and with its layers, for docs/layers.md."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from studies.page import DOCS, Docs, Page
from testbed.files import write_figure
from testbed.frame import Frame
from testbed.replay.recording import record
from testbed.replay.rescan import replay
from trackers.geometry import box_corners, to_frame

DRIVES = {"truck-convoy": 6.0, "dense-traffic": 6.0}  # [s] the moment that is drawn
TRACKERS = {"pmht-spline": "the filter alone", "imm-spline": "the same filter in its layers"}
SEED, RADAR = 400, "surround"
REACH = (-50.0, 90.0, -16.0, 16.0)  # [m] around the ego, in its frame


def main(docs: Docs = DOCS) -> None:
    """Draw truck-convoy and dense-traffic and write pictures/layers-NAME.png."""
    for scenario, moment in DRIVES.items():
        last: list[Frame] = []

        def keep(frame: Frame, last: list[Frame] = last) -> None:
            last[:] = [frame]

        replay(record(scenario, SEED, RADAR, moment), list(TRACKERS), [keep])
        figure = Figure(figsize=(13, 7.4), layout="constrained")
        for axes, name in zip(figure.subplots(len(TRACKERS)), TRACKERS, strict=True):
            _draw(axes, last[0], name)
            axes.set_title(f"{scenario}, {last[0].time:.1f} s: {name}, {TRACKERS[name]}", fontsize=10, loc="left")
        write_figure(Page("layers", docs).picture(f"layers-{scenario}"), figure, dpi=100)


def _draw(axes: Axes, frame: Frame, tracker: str) -> None:
    """Truth grey, boxes of reported tracks green with the standard deviations of their lengths, detections dots."""
    ego, tracks = frame.scene.ego, frame.outputs[tracker][0].reported
    for outline in (ego.outline, *frame.scene.bodies.outline):
        axes.add_patch(Polygon(to_frame(ego.pose, outline), facecolor="0.85", edgecolor="0.5", linewidth=0.8))
    z = to_frame(ego.pose, frame.scan.xy[frame.scan.mask])
    axes.plot(z[:, 0], z[:, 1], ".", color="#c03060", markersize=3)
    e = tracks.estimate
    for pose, size, std in zip(e.pose, e.size, e.size_std, strict=True):
        axes.add_patch(Polygon(to_frame(ego.pose, box_corners(pose, size)), fill=False, edgecolor="#107040"))
        centre = to_frame(ego.pose, pose[None, :2])[0]
        inside = REACH[0] < centre[0] < REACH[1] and REACH[2] < centre[1] < REACH[3]
        if inside:
            text = f"{size[0]:.1f} ± {std[0]:.1f}"
            axes.text(centre[0], centre[1], text, fontsize=7, ha="center", va="center", color="#107040")
    axes.set(aspect="equal", xlim=REACH[:2], ylim=REACH[2:], xlabel="ahead of the ego [m]", ylabel="left [m]")
    axes.set_axisbelow(True)
    axes.grid(visible=True, color="0.93")
