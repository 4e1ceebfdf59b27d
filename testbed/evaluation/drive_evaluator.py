"""How the ego drove, frame by frame: the scenes of one drive in, its row of metrics out."""

from dataclasses import dataclass, field

import numpy as np

from sensors.scene import Scene
from testbed.evaluation import metric
from testbed.evaluation.driving import DriveCurves, DriveFrame, DriveRecord, drive_frame
from trackers.geometry import unit


@dataclass
class DriveEvaluator:
    """Measures of the ego's drive: call `step` once a frame, then `summary`."""

    harsh: float = -4.0  # [m/s^2] braking below this is harsh
    released: float = -2.0  # [m/s^2] it ends above this; in between it goes on
    _frames: list[DriveFrame] = field(default_factory=list, init=False, repr=False)
    _time: list[float] = field(default_factory=list, init=False, repr=False)
    _last: Scene | None = field(default=None, init=False, repr=False)
    _progress: float = field(default=0.0, init=False, repr=False)
    _off_road: float = field(default=0.0, init=False, repr=False)
    _collisions: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        """Refuse thresholds without hysteresis."""
        if not self.harsh < self.released:
            raise ValueError(f"released must lie above harsh, got {self.released} and {self.harsh} m/s^2; swap them")

    def step(self, scene: Scene) -> DriveFrame:
        """Measures at one scene; scenes come in the order of time. Raises ValueError otherwise."""
        last = self._last
        if last is not None and scene.time <= last.time:
            raise ValueError(
                f"scene.time must grow, got {scene.time} s after {last.time} s; one evaluator for each run"
            )
        if last is not None:
            step = scene.ego.pose[:2] - last.ego.pose[:2]
            self._progress += float(step @ unit(last.ego.pose[2]))  # (MET.23)
            self._off_road += 0.0 if scene.ego.on_road else scene.time - last.time
        self._collisions += bool(scene.ego.crashed and (last is None or not last.ego.crashed))
        frame = drive_frame(scene, last)
        self._frames.append(frame)
        self._time.append(scene.time)
        self._last = scene
        return frame

    @property
    def curves(self) -> DriveCurves:
        """The drive so far."""
        frames = np.array(self._frames, float).reshape(-1, len(DriveFrame._fields))
        return DriveCurves(np.array(self._time), *frames.T)

    def summary(self) -> dict[str, float | int]:
        """The drive in one flat row; inf where no body was ever near, NaN where nothing was measured."""
        if not self._frames:
            return dict.fromkeys(metric.keys(metric.DRIVE), np.nan)
        record = DriveRecord(self.curves, self._progress, self._collisions, self.harsh, self.released, self._off_road)
        return metric.values(metric.DRIVE, record)
