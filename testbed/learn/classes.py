"""The catalogue of contour classes that `pmht-spline-adaptive` tells apart: `python -m testbed.learn.classes`.

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
from testbed.learn.detections import CLASSES, sample
from testbed.learn.spline import fit
from trackers.pmht import classes, model
from trackers.pmht.offline import OfflineLearning

ARTICULATED = (16.5, 2.55)  # [m] tractor unit and trailer


def learn(name: str, count: int, radar: str = "surround") -> model.SplineModel:
    """The model of a class from `count` detections of all its sizes; the size of the model is the mean of the class."""
    detections = sample(sensors.find(radar), name, count, np.random.default_rng(0), table=CLASSES)
    length, width = ARTICULATED if name == "articulated" else CONTOURS[name].size.tolist()
    return replace(fit(detections, OfflineLearning(), name)[0], size=(length, width))


def main(
    count: Annotated[int, typer.Option(min=1000, help="Detections of each class.")] = 6000,
    out: Annotated[Path, typer.Option(help="Folder of the models.")] = classes.FOLDER,
) -> None:
    """Learn every class and write it to a folder."""
    out.mkdir(parents=True, exist_ok=True)
    for name in CLASSES:
        found = learn(name, count)
        command = f"python -m testbed.learn.classes --count {count}"
        write_json(out / f"{name}.json", model.as_json(found, {"command": command}))
        typer.echo(f"{name}: {found.size[0]:.2f} x {found.size[1]:.2f} m, {found.interior:.0%} from inside")


if __name__ == "__main__":
    typer.run(main)
