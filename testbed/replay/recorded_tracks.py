"""Tracks from a file in place of a tracker: the format of `columns.TRACKS`, at the times of the scans of a recording.

What a file does not say stays unknown: a covariance is NaN, and NEES is left out. Which detections a track has taken is
taken from their places, as for the truth of a recording: those in its box, grown by `truth.GROWN`.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import Origin
from sensors.scene import Scene
from testbed.environment.validation import ESTIMATE
from testbed.replay.columns import EDGES, RADIANS, TRACKS
from testbed.replay.interpolation import Between, between
from testbed.replay.loaded import Loaded
from testbed.replay.reading import Recorded
from testbed.replay.tables import SUFFIXES, read_file
from testbed.replay.tracks_file import PLACES
from testbed.replay.truth import numbers_of, owners_by_place, parse_contour, rows_of_each
from trackers.estimate import Estimate
from trackers.geometry import wrap_angle
from trackers.multi.road import RoadMap
from trackers.multi.tracks import REPORT_ABOVE, StepInfo, Tracks
from trackers.scan import Scan

TOLERANCE = 0.01  # [s] from a scan up to which a row is of it
GAP = 0.5  # [s] between two rows of a track that are interpolated, where that is wished
SHAPES = {**ESTIMATE, "edge_std": (len(EDGES),)}  # axes behind those of the rows
LONGEST = 60  # letters of a name
DRIVES, OFF, RIGHT = 5.0, 0.5, 0.1  # [m/s] with a course; [rad] between heading and course that is wrong, that is right


class Matching(NamedTuple):
    """How rows belong to scans."""

    tolerance: float = TOLERANCE  # [s]
    interpolate: bool = False  # between two rows of a track, up to `GAP` apart; the tolerance is not used then

    def check(self) -> None:
        """Raise ValueError for a tolerance that is none."""
        if not 0 <= self.tolerance <= 1:
            raise ValueError(f"tolerance must be within 0 and 1 s, got {self.tolerance:g}; interpolate for more")


class TracksSource(NamedTuple):
    """A file, and how it is read."""

    path: Path
    columns: tuple[tuple[str, str], ...] = ()  # column of the table, its name in the file
    matching: Matching = Matching()


@dataclass(frozen=True)
class RecordedTracks:
    """The tracks of a file at the scans of a recording, to be mounted as a tracker."""

    name: str
    steps: Mapping[float, tuple[Tracks, StepInfo]]  # time [s] of the scene -> tracks, and what a step would say
    said: str = ""  # what was left out, in a sentence

    def start_on(self, road: RoadMap) -> None:
        """Nothing is kept."""

    def step_on_truth(self, state: Any, scan: Scan, scene: Scene, origin: Origin) -> tuple[Any, Tracks, StepInfo]:
        """The tracks at the time of the scene, of which nothing else is used."""
        tracks, info = self.steps[scene.time]
        return None, tracks, info


def columns_of(text: str | None) -> tuple[tuple[str, str], ...]:
    """Columns of the table with their names in a file, of `COLUMN=NAME,COLUMN=NAME` or a TOML file of such lines."""
    if not text:
        return ()
    try:
        if text.endswith(".toml"):
            found: dict[str, Any] = tomllib.loads(Path(text).read_text(encoding="utf-8"))
        else:
            found = dict(part.split("=") for part in text.split(","))
    except (OSError, ValueError) as error:
        raise ValueError(f"columns: {text!r} is not like x=pos_x,y=pos_y, nor such a TOML file ({error})") from None
    for name, value in found.items():
        if name not in TRACKS.names:
            raise ValueError(f"columns: there is no column {name!r}; choose of {', '.join(TRACKS.names)}")
        if not isinstance(value, str) or not value:
            raise ValueError(f"columns: {name} must be the name of a column of the file, got {value!r}; give a text")
    if len(set(found.values())) < len(found):
        raise ValueError(f"columns: two columns have one name, {', '.join(found.values())}; give each its own")
    return tuple(found.items())


def recorded_tracks(source: TracksSource, name: str, recorded: Recorded) -> list[RecordedTracks]:
    """The tracks of a file under a name, those of several trackers apart as NAME/TRACKER.

    Raises ValueError, in one sentence, where the file is wrong or has another clock.
    """
    table, keys = _read(source)
    match = _interpolated if source.matching.interpolate else _nearest
    scan, where, said = match(table, keys, recorded.times, source.matching.tolerance)
    order = np.lexsort((where.first, scan))
    scan, where = scan[order], Between(*(part[order] for part in where))
    trackers = table.texts("tracker")
    different, found = list(dict.fromkeys(trackers.tolist() or [""])), []
    for tracker in different:
        called = f"{name}/{tracker}" if different[1:] else name
        if not (called.strip() and called.isprintable() and len(called) <= LONGEST):
            raise ValueError(f"tracks: {called[:LONGEST]!r} is no name; give one of letters, at most {LONGEST}")
        own = trackers[where.first] == tracker
        steps = _steps(
            table, _contours(table, trackers == tracker), scan[own], Between(*(p[own] for p in where)), recorded
        )
        found.append(RecordedTracks(called, steps, said))
    return found


def _read(source: TracksSource) -> tuple[Loaded, NDArray]:
    """The table of a file, and the tracker with the id of each row (N,)."""
    path = source.path
    if path.suffix not in SUFFIXES or not path.is_file():
        what = "is not there" if not path.exists() else "is no table of tracks"
        raise ValueError(f"tracks: {path} {what}; give files {' or '.join(SUFFIXES)}")
    table = read_file(path, TRACKS, {other: name for name, other in source.columns})
    table.check("id", table["id"] == "", lambda row: "it is empty", "give each track its id")
    keys = np.char.add(np.char.add(table.texts("tracker"), "\n"), table["id"])
    rows_of_each(table, keys)  # which finds what is there twice
    _check_headings(table)
    _check_covariances(table)
    return table, keys


def _check_headings(table: Loaded) -> None:
    """Raise the error about headings in degrees: those of tracks that move are their courses then."""
    heading, vx, vy = (table[name] for name in ("heading", "vx", "vy"))
    moves = np.hypot(vx, vy) > DRIVES
    off, other = (np.abs(wrap_angle(h - np.arctan2(vy, vx)))[moves] for h in (heading, np.radians(heading)))
    if moves.any() and np.median(off) > OFF and np.median(other) < RIGHT:
        row = int(np.flatnonzero(moves)[off.argmax()])
        raise table.fault("heading", row, f"{heading[row]:g} fits the velocity in degrees only", RADIANS)


def _check_covariances(table: Loaded) -> None:
    """Raise the error about the first covariance that is none; one that is not given is NaN."""
    cov = _field(table, "cov")
    for part, name in ((cov[:, :2, :2], "cov_x_x"), (cov[:, 2:, 2:], "cov_vx_vx"), (cov, "cov_x_vx")):
        known = np.isfinite(part).all((-2, -1))
        wrong = np.zeros(table.rows, bool)
        wrong[known] = np.linalg.eigvalsh(part[known])[..., 0] <= 0
        if wrong.any():
            what = "the covariance has an eigenvalue that is not above 0"
            raise table.fault(name, int(wrong.argmax()), what, "correct it, or leave its columns out")
    for name in (name for name in TRACKS.names if name.endswith("_std")):
        table.check(name, table.numbers(name, np.nan) == 0, lambda row: "it is 0", "leave it empty if it is unknown")


def _field(table: Loaded, field: str) -> NDArray:
    """A field of the estimate (N, ...), NaN where nothing is given."""
    found = np.full((table.rows, *SHAPES[field]), np.nan)
    for name, (of, place) in PLACES.items():
        if of == field:
            for index in (place, place[::-1]):
                at: Any = (slice(None), *index)
                found[at] = table.numbers(name, np.nan)
    return found


def _steps(
    table: Loaded, contour: NDArray | None, scan: NDArray, where: Between, recorded: Recorded
) -> dict[float, tuple[Tracks, StepInfo]]:
    """By time of the scene the tracks of one tracker: K rows `where`, each of a scan (K,), in the order of these."""
    rows = where.first
    known = {field: _between(where, _field(table, field), field) for field in SHAPES}
    if np.isnan(known["edge_std"]).all():
        del known["edge_std"]  # as of a filter that states none: centre and size are independent
    ids = numbers_of(table["id"])
    number = np.array([ids[text] for text in table["id"].tolist()], int)[rows]
    existence, hits = table.numbers("existence", 1.0)[rows], table.numbers("detections", 0.0)[rows].astype(int)
    time = recorded.times[scan]
    born = dict(zip(number[::-1].tolist(), time[::-1].tolist(), strict=True))  # the first time is the last one here
    age = table.numbers("age", np.nan)[rows]
    age = np.where(np.isnan(age), time - np.array([born[i] for i in number.tolist()]), age)
    ends, steps = np.searchsorted(scan, np.arange(len(recorded.frames) + 1)).tolist(), {}
    for frame, a, b in zip(recorded.frames, ends[:-1], ends[1:], strict=True):
        outline = None if contour is None or where.share[a:b].any() else contour[rows[a:b]]
        estimate = Estimate(**{field: value[a:b] for field, value in known.items()}, contour=outline)
        tracks = Tracks(number[a:b], existence[a:b], hits[a:b], age[a:b], existence[a:b] > REPORT_ABOVE, None, estimate)
        steps[frame.scene.time] = tracks, _info(tracks, frame.scan)
    return steps


def _between(where: Between, value: NDArray, field: str) -> NDArray:
    """Values at scans of a field; of the heading the shorter way round."""
    found = where.of(value)
    if field == "pose":
        found[:, 2] = where.angle(value[:, 2])
    return found


def _info(tracks: Tracks, scan: Scan) -> StepInfo:
    """What a step would have said: the detections in the box of a track are its own."""
    row = owners_by_place(tracks.estimate.pose, tracks.estimate.size, scan.xy)
    count = np.bincount(row[row >= 0], minlength=len(tracks.id))
    unknown = np.full(len(tracks.id), np.nan)
    owner = np.append(tracks.id, -1)[row]
    return StepInfo(owner, tracks.id, unknown, unknown == unknown, count, unknown, unknown, ())


def _contours(table: Loaded, own: NDArray) -> NDArray | None:
    """Outlines (N, C, 2) [m] of the rows (N,) of one tracker, None where there are none."""
    texts = table.texts("contour")
    rows = np.flatnonzero(own)
    if not (texts[rows] != "").any():
        return None
    found = None
    for row in rows.tolist():
        try:
            (outline,) = parse_contour(str(texts[row]))
        except ValueError:
            remedy = "write x y;x y;x y for all rows of a tracker, or for none"
            raise table.fault("contour", row, f"{texts[row][:60]!r} is no outline", remedy) from None
        if found is None:
            found = np.zeros((table.rows, *outline.shape))
        if outline.shape != found.shape[1:]:
            what = f"it has {len(outline)} points, others have {found.shape[1]}"
            raise table.fault("contour", row, what, "give all of a tracker the same number")
        found[row] = outline
    return found


def _nearest(table: Loaded, keys: NDArray, times: NDArray, tolerance: float) -> tuple[NDArray, Between, str]:
    """Scans of the rows that are near enough to one, of a track the nearest; these rows; and what is left out."""
    time = table["time"]
    after = np.clip(np.searchsorted(times, time), min(1, len(times) - 1), len(times) - 1)
    before = np.maximum(after - 1, 0)
    scan = np.where(time - times[before] <= times[after] - time, before, after)
    off = np.abs(times[scan] - time)
    good = np.flatnonzero(off <= tolerance + 1e-9)
    if table.rows and not len(good):
        raise _wrong_clock(table, times, float(off.min()))
    track = np.unique(keys, return_inverse=True)[1]
    good = good[np.argsort(off[good], kind="stable")]
    rows = good[np.unique(scan[good] * (len(keys) + 1) + track[good], return_index=True)[1]]
    left = table.rows - len(rows)
    said = (
        f"{left} of {table.rows} rows are of no scan and left out, up to {off.max(initial=0):.3g} s off" if left else ""
    )
    return scan[rows], Between(rows, rows, np.zeros(len(rows)), np.ones(len(rows), bool)), said


def _interpolated(table: Loaded, keys: NDArray, times: NDArray, tolerance: float) -> tuple[NDArray, Between, str]:
    """Scans at which a track is between two of its rows, up to `GAP` apart; these rows; nothing is left out."""
    parts = [(np.zeros(0, int), np.zeros(0, int), np.zeros(0, int), np.zeros(0))]
    for rows in rows_of_each(table, keys):
        where = between(table["time"][rows], times, GAP)
        at = np.flatnonzero(where.known)
        parts.append((at, rows[where.first[at]], rows[where.second[at]], where.share[at]))
    scan, first, second, share = (np.concatenate(column) for column in zip(*parts, strict=True))
    if table.rows and not len(scan):
        raise _wrong_clock(table, times, float(np.abs(table["time"][:, None] - times[[0, -1]]).min()))
    return scan, Between(first, second, share, np.ones(len(scan), bool)), ""


def _wrong_clock(table: Loaded, times: NDArray, off: float) -> ValueError:
    time = table["time"]
    what = f"tracks are from {time.min():.2f} s to {time.max():.2f} s, scans from {times[0]:.2f} s to {times[-1]:.2f} s"
    remedy = (
        f"no row is at a scan, the nearest is {off:.3g} s off: give both one clock, a --tolerance, or --interpolate"
    )
    return table.fault("time", 0, what, remedy)


def of_all(sources: Sequence[tuple[str, TracksSource]], recorded: Recorded) -> list[RecordedTracks]:
    """The tracks of several files with their names; ValueError as in `recorded_tracks`, or for one name twice."""
    found = [one for name, source in sources for one in recorded_tracks(source, name, recorded)]
    names = [one.name for one in found]
    if len(set(names)) < len(names):
        raise ValueError(f"tracks must have different names, got {', '.join(names)}; rename a file, or give NAME=FILE")
    return found
