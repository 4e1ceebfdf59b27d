"""A recorded drive given to trackers as if it were live: the same scans in the same order, to the same observers."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sensors.fault_text import faults_of
from sensors.faults import streams
from sensors.origin import Origin
from sensors.scene import Scene
from testbed.environment.perception import Perception, RadarLike, radar_of
from testbed.environment.recorder import Recorder
from testbed.files import versions
from testbed.frame import Observer
from testbed.log.record import RunMeta, run_id
from testbed.replay.recording import RecordedFrame, Recording
from trackers.multi.road import RoadMap
from trackers.scan import Scan, SensorModel

REPLAY = "replay"  # in place of the planner's name and of its action: a replay has no planner


class RecordedRadar:
    """The radar of recorded frames: a scan of a recorded scene is the recorded one."""

    def __init__(self, models: tuple[SensorModel, ...], rate: float | None, frames: Sequence[RecordedFrame]) -> None:
        self.models, self.rate = models, rate
        self._frames = {frame.scene.time: frame for frame in frames}

    def scan(self, scene: Scene, rng: np.random.Generator) -> tuple[Scan, Origin]:
        """The recorded scan of this scene; the generator is not used."""
        frame = self._frames[scene.time]
        return frame.scan, frame.origin


def replay(
    recording: Recording, trackers: Sequence[str], observers: Sequence[Observer], faults: Any = ()
) -> Perception:
    """Give all recorded scans to trackers, and every frame to the observers, with faults put into the scans if any.

    See `rescan` for the frames and for what is returned.
    """
    unused = np.random.default_rng(0)  # a recorded radar draws nothing
    radar = radar_of(recording.radar)
    recorded = RecordedRadar(radar.models, radar.rate, recording.frames)
    return rescan(recording, recorded, unused, trackers, observers, faults)


def rescan(
    recording: Recording,
    radar: RadarLike,
    rng: np.random.Generator,
    trackers: Sequence[str],
    observers: Sequence[Observer],
    faults: Any = (),
) -> Perception:
    """Scan the recorded scenes with a radar and its generator, track, and give every frame to the observers.

    Faults are put into the scans if any. `step` of a frame is its index in the recording. Returns the perception that
    did it: its `seconds` and `costs` say where the time went.
    """
    perception = Perception.mount(radar, trackers, faults)
    rngs = streams(perception.faults, recording.seed)
    perception.observers.extend(observers)
    for _ in through(perception, recording.frames, recording.road, rng, rngs):
        pass
    return perception


def through(
    perception: Perception,
    frames: Sequence[RecordedFrame],
    road: RoadMap,
    rng: np.random.Generator,
    fault_rngs: Sequence[np.random.Generator] = (),
) -> Iterator[int]:
    """Scan one recorded scene after the other; yields how many were scanned.

    The generators are those of the radar and of its faults, as `Perception.start` has them.
    """
    perception.start(lambda k: frames[k].scene, road, rng, action=REPLAY, fault_rngs=fault_rngs)
    perception.notify()
    yield 1
    for k in range(1, len(frames)):
        perception.step(REPLAY, np.zeros((0, 2)))
        yield k + 1


def write_log(recording: Recording, trackers: Sequence[str], out: Path, faults: Sequence[str] = ()) -> Path:
    """The review log of a replay, with the trackers side by side and faults if any; returns its path.

    Raises OSError, in one sentence, where it cannot be written completely.
    """
    meta = RunMeta(
        run_id(recording.scenario, trackers, recording.radar, REPLAY, recording.seed, None, faults),
        recording.scenario, recording.seed, recording.radar, tuple(trackers), REPLAY,
        {"faults": list(faults)} if faults else {}, versions(),
    )  # fmt: skip
    sensors = radar_of(recording.radar).models
    recorder = Recorder(meta, out, "full", recording.phases, recording.drawn, sensors, faults=faults_of(faults))
    try:
        replay(recording, trackers, [recorder], faults)
    finally:
        recorder.close()
    for sentence in recorder.lost:
        raise OSError(sentence)
    return out / f"{meta.run_id}.rrd"
