"""Figure: range rates that fold, those of turning wheels, and sensors one after another, for docs/methods/radar.md."""

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sensors import RADARS, Radar
from sensors.rigs import staggered
from sensors.scene import boxes_scene
from studies.page import DOCS, Docs, Page
from testbed.files import write_figure

SCANS, SPEED, FOLD = 40, 20.0, 12.0  # of each picture; [m/s] of the car, and at which rates fold
ASPECTS = ((40.0, 5.0), (28.0, 28.0))  # [m] where it is seen: nearly from behind, and at 45 degrees


def polar(place: tuple[float, float], **parameters: Any) -> NDArray:
    """Detections (M, 3) of one car by a high-resolution radar that stands."""
    sensor = replace(RADARS["imaging"].sensors[0], mount=(0.0, 0.0, 0.0), clutter=0.0, **parameters)
    pose, size, velocity = (np.array([one]) for one in ((*place, 0.0), (4.6, 1.8), (SPEED, 0.0)))
    scene, rng = boxes_scene(pose, size, velocity), np.random.default_rng(0)
    return np.concatenate([Radar("one", "for a picture", (sensor,)).scan(scene, rng)[0].polar for _ in range(SCANS)])


def main(docs: Docs = DOCS) -> None:
    """Draw what the limits do to the detections of one car and write pictures/radar-limits.png."""
    figure = Figure(figsize=(13, 3.6), layout="constrained")
    folds, wheels, times = figure.subplots(1, 3)
    for place, colour in zip(ASPECTS, ("#0072B2", "#D55E00"), strict=True):
        label = f"seen under {np.degrees(np.arctan2(place[1], place[0])):.0f} degrees"
        for axis, parameters in ((folds, {"fold_rate": FOLD}), (wheels, {"wheels": 0.3})):
            r, a, rate = polar(place, **parameters).T
            axis.plot(r * np.cos(a) - place[0], rate, ".", color=colour, markersize=3, alpha=0.4, label=label)
            axis.set(xlabel="along the car [m]", ylabel="range rate [m/s]", xlim=(-3, 3))
    folds.set_title(f"fold_rate = {FOLD:g} m/s", fontsize=10)
    wheels.set_title("wheels = 0.3, nothing folds", fontsize=10)
    folds.legend(fontsize=8)
    radar = staggered(RADARS["surround"], 10.0)
    due = np.array([radar.due(k / 60, 1 / 60) for k in range(1, 25)])
    frame, sensor = np.nonzero(due)
    times.plot((frame + 1) / 60, sensor, "s", color="#009E73")
    times.set(xlabel="time [s]", ylabel="sensor that measures", title="staggered(surround, 10.0)")
    times.title.set_fontsize(10)
    write_figure(Page("methods/radar", docs).picture("radar-limits"), figure, dpi=90)
