"""A recording of a folder given to trackers: log, results and tracks, as of a run."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from testbed.command_line.interruption import interruptible
from testbed.environment.perception import Cost, Perception, tracker_of
from testbed.environment.recorder import Recorder, check_level
from testbed.environment.validation import WrongTracks
from testbed.evaluation.tracking import jsonable
from testbed.files import check_target, make_directory, noting_losses, versions
from testbed.frame import TRUTH, Frame
from testbed.limits import check_choice, check_folder, check_names
from testbed.log.record import RunMeta
from testbed.replay.plausibility import faults, judged
from testbed.replay.reading import Recorded
from testbed.replay.recorded_tracks import TracksSource, of_all
from testbed.replay.rescan import REPLAY, RecordedRadar, through
from testbed.replay.tables import FORMATS
from testbed.replay.tracks_file import TracksFile
from trackers import DEFAULT

RECORDED = "recorded"  # in place of the name of a radar
ACCEPT = "--accept-implausible"


@dataclass(frozen=True)
class ReplayConfig:
    """What `testbed replay` varies."""

    folder: str  # of the tables
    trackers: tuple[str, ...] = (DEFAULT,)
    start: float | None = None  # [s] after the first scan, None: from it on
    end: float | None = None  # [s], None: to the last
    out: str = "runs"
    log: str = "full"
    fixes: tuple[str, ...] = ()  # what is put right, see `testbed.replay.fixes`
    accept: bool = False  # replay what cannot be right too
    tracks: tuple[tuple[str, TracksSource], ...] = ()  # files of tracks beside the trackers, with their names
    format: str = "parquet"  # of the file of tracks

    def __post_init__(self) -> None:
        if self.trackers or not self.tracks:
            check_names("trackers", self.trackers)
        check_choice("format", self.format, FORMATS)
        check_folder(self.out)
        check_level(self.log, True)


@dataclass(frozen=True)
class ReplayResult:
    """Results and files of a replay; those that could not be written are None."""

    result: dict[str, Any]  # see `Recorder.result`
    lives: dict[str, dict[str, float]]  # tracker -> numbers and lives of its tracks
    json: Path | None
    rrd: Path | None
    tracks: Path | None
    exit_status: int  # 0, 128 + signal where one ended the replay early, 2 where `lost` says something
    lost: tuple[str, ...] = ()  # in sentences, what could not be written, or why a tracker ended the replay


def prepare(config: ReplayConfig) -> Recorded:
    """The recording, read and checked with all else.

    Raises:
        LookupError: an unknown tracker; the nearest name is suggested.
        ValueError, OSError: in one sentence, a fault of the tables, what cannot be right, or a folder for the
            results that cannot be.
    """
    recorded, found = judged(Path(config.folder), config.start, config.end, config.fixes)
    if (wrong := faults(found)) and not config.accept:
        raise ValueError(f"{' '.join(f'{sentence}.' for sentence in wrong)} Or go on with {ACCEPT}")
    radar = RecordedRadar(recorded.sensors.models, None, recorded.frames)
    for name in config.trackers:
        if name == TRUTH and recorded.known is None:
            raise ValueError(f"tracker {TRUTH} needs a table truth, {config.folder} has none; choose another tracker")
        tracker_of(name, radar)
    recorded = recorded._replace(tracks=tuple(of_all(config.tracks, recorded)))
    if both := {*config.trackers} & {one.name for one in recorded.tracks}:
        raise ValueError(f"tracks {min(both)!r} have the name of a tracker; give --name")
    make_directory(Path(config.out))
    check_target(tracks_path(config, recorded))
    return recorded._replace(findings=tuple(found))


def replay_id(config: ReplayConfig, recorded: Recorded) -> str:
    """Name of the files of a replay: the same settings give the same name."""
    window = [f"from{config.start:g}s"] if config.start is not None else []
    window += [f"to{config.end:g}s"] if config.end is not None else []
    return "_".join([recorded.name, "+".join(names(config, recorded)), REPLAY, *window]).replace("/", "-")


def names(config: ReplayConfig, recorded: Recorded) -> tuple[str, ...]:
    """Those of the trackers, then those of tracks from files."""
    return (*config.trackers, *(one.name for one in recorded.tracks))


def tracks_path(config: ReplayConfig, recorded: Recorded) -> Path:
    """Where the tracks go."""
    return Path(config.out) / f"{replay_id(config, recorded)}.{config.format}"


def replay(
    config: ReplayConfig, recorded: Recorded, progress: Callable[[int, int], None] = lambda done, total: None
) -> ReplayResult:
    """Give all scans to the trackers; progress(done, total) is called once a scan.

    Ctrl-C or SIGTERM ends the replay after the scan at hand: what was tracked until then is written and returned.
    """
    radar = RecordedRadar(recorded.sensors.models, None, recorded.frames)
    perception = Perception.mount(radar, (*config.trackers, *recorded.tracks))
    recorder = Recorder(
        _meta(config, recorded), config.out, config.log, (), recorded.drawn, radar.models,
        trackers=perception.trackers, known=recorded.known,
    )  # fmt: skip
    tracks, lives = TracksFile(tracks_path(config, recorded), recorded.times, recorder.lost), Lives()
    perception.observers.extend([recorder, tracks, lives])
    total, done = len(recorded.frames), 0
    unused = np.random.default_rng(0)  # a recorded radar draws nothing
    start, cpu = perf_counter(), process_time()
    with interruptible() as interrupt, tracks:
        try:
            for done in through(perception, recorded.frames, recorded.road, unused):
                progress(done, total)
                if interrupt.signal is not None:
                    break
        except WrongTracks as error:
            recorder.lost.append(f"{error}; the replay ends after {done} of {total} scans")
        finally:
            timing: dict[str, Any] = {**perception.seconds, **recorder.seconds, "wall": perf_counter() - start}
            timing["cpu"] = process_time() - cpu
            costs = perception.costs | {one.name: Cost() for one in recorded.tracks}  # reading is no tracking
            timing["trackers"] = {name: jsonable(cost.row()) for name, cost in costs.items()}
            with noting_losses(recorder.lost):
                recorder.close(interrupted=done < total, timing=timing)
    lost, log = tuple(recorder.lost), recorder.log.file if recorder.log else None
    status = (interrupt.exit_status if done < total else 0) or (2 if lost else 0)
    return ReplayResult(recorder.close(), lives.rows(), recorder.written, log, tracks.written, status, lost)


def _meta(config: ReplayConfig, recorded: Recorded) -> RunMeta:
    window = {"from": config.start, "to": config.end}
    varied = {
        "sensors": list(recorded.sensors.names),
        "scans": len(recorded.frames),
        **{f"{name} [s]": value for name, value in window.items() if value is not None},
    }
    name = replay_id(config, recorded)
    return RunMeta(
        name, recorded.name, 0, RECORDED, names(config, recorded), REPLAY, varied, versions(), recorded.names
    )


class Lives:
    """Observer of the reported tracks of each tracker."""

    def __init__(self) -> None:
        self._scans: dict[str, int] = defaultdict(int)
        self._times: dict[str, dict[int, list[float]]] = defaultdict(dict)  # tracker -> track -> first, last [s], scans

    def __call__(self, frame: Frame) -> None:
        """Take the tracks of one frame."""
        for name, (tracks, _) in frame.outputs.items():
            self._scans[name] += 1
            for number in tracks._replace(state=None).reported.id.tolist():
                seen = self._times[name].setdefault(number, [frame.time, frame.time, 0])
                seen[1:] = frame.time, seen[2] + 1

    def rows(self) -> dict[str, dict[str, float]]:
        """By tracker: tracks reported, tracks a scan, median and longest life [s]."""
        return {name: self._row(name) for name in self._scans}

    def _row(self, name: str) -> dict[str, float]:
        first, last, scans = np.array(list(self._times[name].values()), float).reshape(-1, 3).T
        life = last - first
        return {
            "tracks_reported": len(life),
            "tracks_per_scan": float(scans.sum()) / self._scans[name],
            "life_median": float(np.median(life)) if len(life) else np.nan,
            "life_longest": float(life.max(initial=0.0)),
        }
