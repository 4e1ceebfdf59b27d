"""The catalogue of contour classes that `pmht-spline-adaptive` tells apart.

Each class is a model as `testbed learn-spline` makes them, learned from our radar on lone vehicles of that outline. It
says which part of the outline gives detections and how far they lie off it; the outlines are those of
`scenarios.contours`.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import sensors
from scenarios.contours import CONTOURS
from testbed.files import write_json
from testbed.learn.detections import Make, sample
from testbed.learn.models import fit_spline
from trackers.pmht import classes, model
from trackers.pmht.offline import OfflineLearning

CLASSES: dict[str, tuple[Make, ...]] = {
    "car": (Make("car", (3.6, 5.3), (1.65, 2.05), 1.0),),
    "van": (Make("van", (4.8, 6.5), (1.85, 2.1), 1.0),),
    "truck": (Make("truck", (6.5, 11.0), (2.25, 2.6), 1.0),),
    "bus": (Make("bus", (9.0, 15.0), (2.4, 2.6), 1.0),),
    "articulated": (Make("articulated", (12.0, 18.0), (2.4, 2.6), 1.0),),
    "tractor": (Make("tractor", (4.2, 5.8), (2.2, 2.6), 1.0),),
    "motorcycle": (Make("motorcycle", (1.9, 2.5), (0.7, 0.9), 1.0),),
}
ARTICULATED = (16.5, 2.55)  # [m] tractor unit and trailer


def learn(name: str, count: int, radar: str = "surround") -> model.SplineModel:
    """The model of a class from `count` detections of all its sizes; the size of the model is the mean of the class."""
    detections = sample(sensors.find(radar), name, count, np.random.default_rng(0), table=CLASSES)
    length, width = ARTICULATED if name == "articulated" else CONTOURS[name].size.tolist()
    return replace(fit_spline(detections, OfflineLearning(), name)[0], size=(length, width))


def main(
    count: Annotated[int, typer.Option(min=1000, help="Detections of each class.")] = 6000,
    out: Annotated[Path, typer.Option(help="Folder of the models.")] = classes.FOLDER,
) -> None:
    """Learn every class and write it to a folder."""
    out.mkdir(parents=True, exist_ok=True)
    for name in CLASSES:
        found = learn(name, count)
        command = f"python -m studies contour-classes --count {count}"
        write_json(out / f"{name}.json", model.as_json(found, {"command": command}))
        typer.echo(f"{name}: {found.size[0]:.2f} x {found.size[1]:.2f} m, {found.interior:.0%} from inside")
