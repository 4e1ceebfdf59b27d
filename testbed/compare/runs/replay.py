"""A recorded drive given to trackers, as if it were live: the same looks, in the same order, to the same observers."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sensors.scene import Scene
from sensors.origin import Origin
from testbed.compare.runs.recording import Recording
from testbed.log.record import RunMeta
from testbed.environment.perception import Perception, radar_of
from testbed.frame import Observer
from testbed.evaluation.recorder import Recorder, run_id
from testbed.files import versions
from trackers.scan import Scan

REPLAY = "replay"  # in place of the planner's name and choice: nobody chooses


class Tape:
    """The radar of a recording: it sees again what it saw."""

    def __init__(self, recording: Recording) -> None:
        radar = radar_of(recording.radar)
        self.models, self.rate = radar.models, radar.rate
        self._looks = {look.scene.time: look for look in recording.looks}

    def scan(self, scene: Scene, rng: np.random.Generator) -> tuple[Scan, Origin]:
        """The recorded look at this scene; the generator is left alone."""
        look = self._looks[scene.time]
        return look.scan, look.origin


def replay(recording: Recording, trackers: Sequence[str], observers: Sequence[Observer]) -> Perception:
    """Feed all looks to trackers, and what these say to the observers; returns the senses that did it.

    `seconds` and `costs` of what is returned tell where the time went.
    """
    senses = Perception.mount(Tape(recording), trackers)
    senses.observers.extend(observers)
    first, *rest = recording.looks
    senses.start(lambda: first.scene, recording.road, np.random.default_rng(0))
    senses.tell(REPLAY, np.zeros((0, 2)))
    for look in rest:
        senses.frame += 1
        senses.look(lambda look=look: look.scene)  # type: ignore[misc]
        senses.tell(REPLAY, np.zeros((0, 2)))
    return senses


def write_log(recording: Recording, trackers: Sequence[str], out: Path) -> Path:
    """The review log of a replay, with the trackers side by side; returns its path."""
    meta = RunMeta(
        run_id(recording.scenario, trackers, recording.radar, REPLAY, recording.seed),
        recording.scenario, recording.seed, recording.radar, tuple(trackers), REPLAY, {}, versions(),
    )  # fmt: skip
    sensors = radar_of(recording.radar).models
    recorder = Recorder(meta, out, "full", recording.phases, recording.drawn, sensors)
    try:
        replay(recording, trackers, [recorder])
    finally:
        recorder.close()
    return out / f"{meta.run_id}.rrd"
