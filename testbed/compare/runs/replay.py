"""A recorded drive given to trackers as if it were live: the same scans in the same order, to the same observers."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sensors.origin import Origin
from sensors.scene import Scene
from testbed.compare.runs.recording import Recording
from testbed.environment.perception import Perception, radar_of
from testbed.environment.recorder import Recorder
from testbed.files import versions
from testbed.frame import Observer
from testbed.log.record import RunMeta, run_id
from trackers.scan import Scan

REPLAY = "replay"  # in place of the planner's name and of its action: a replay has no planner


class RecordedRadar:
    """The radar of a recording: a scan of a recorded scene is the recorded one."""

    def __init__(self, recording: Recording) -> None:
        radar = radar_of(recording.radar)
        self.models, self.rate = radar.models, radar.rate
        self._frames = {frame.scene.time: frame for frame in recording.frames}

    def scan(self, scene: Scene, rng: np.random.Generator) -> tuple[Scan, Origin]:
        """The recorded scan of this scene; the generator is not used."""
        frame = self._frames[scene.time]
        return frame.scan, frame.origin


def replay(recording: Recording, trackers: Sequence[str], observers: Sequence[Observer]) -> Perception:
    """Give all recorded scans to trackers, and every frame to the observers.

    `step` of a frame is its index in the recording. Returns the perception that did it: its `seconds` and `costs` say
    where the time went.
    """
    perception = Perception.mount(RecordedRadar(recording), trackers)
    perception.observers.extend(observers)
    perception.start(lambda step: recording.frames[step].scene, recording.road, np.random.default_rng(0), action=REPLAY)
    perception.notify()
    for _ in recording.frames[1:]:
        perception.step(REPLAY, np.zeros((0, 2)))
    return perception


def write_log(recording: Recording, trackers: Sequence[str], out: Path) -> Path:
    """The review log of a replay, with the trackers side by side; returns its path.

    Raises OSError, in one sentence, where it cannot be written completely.
    """
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
    for sentence in recorder.lost:
        raise OSError(sentence)
    return out / f"{meta.run_id}.rrd"
