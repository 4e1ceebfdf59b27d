"""Trackers measured on a recorded drive that another radar sees, for studies that compare radars on the same drives."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sensors import Radar, Sensor
from testbed.evaluation.tracking import Evaluator
from testbed.frame import Frame
from testbed.replay.recording import Recording
from testbed.replay.rescan import rescan


def every_sensor(radar: Radar, change: Callable[[Sensor], Sensor]) -> Radar:
    """The rig with each of its sensors changed."""
    return replace(radar, sensors=tuple(change(sensor) for sensor in radar.sensors))


def measured(
    drive: Recording, radar: Radar, trackers: Sequence[str], measures: Sequence[str]
) -> list[dict[str, float]]:
    """Measures of each tracker, by their names in its summary, on the scenes of a drive as the radar sees them.

    The radar draws from the seed of the drive, so radars that draw alike see alike.
    """
    evaluators = {name: Evaluator(name) for name in trackers}

    def keep(frame: Frame) -> None:
        for name, evaluator in evaluators.items():
            evaluator.step(frame.time, frame.scene, frame.origin, frame.outputs[name][0])

    rescan(drive, radar, np.random.default_rng([drive.seed, 1]), trackers, [keep])
    summaries = [evaluator.summary() for evaluator in evaluators.values()]
    return [{name: float(summary[name]) for name in measures} for summary in summaries]
