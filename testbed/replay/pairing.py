"""Which recordings and files of tracks are meant, and which file is of which recording."""

from collections.abc import Sequence
from glob import escape, glob
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from testbed.replay.columns import DETECTIONS, TRACKS
from testbed.replay.recorded_tracks import TOLERANCE, Matching, TracksSource, columns_of
from testbed.replay.tables import SUFFIXES, path_of, read_file, read_table


class Files(NamedTuple):
    """Recordings, and the files of tracks of each."""

    recordings: list[Path]
    tracks: dict[Path, list[TracksSource]]

    @classmethod
    def of(
        cls,
        tracks: Sequence[str],
        recordings: Sequence[str],
        columns: str | None = None,
        tolerance: float = TOLERANCE,
        interpolate: bool = False,
    ) -> Self:
        """From paths and patterns; a recording among the tracks, where a shell has put it, is one of `recordings`.

        Raises ValueError, in one sentence, for what is not there, or a file that is of no recording.
        """
        matching = Matching(tolerance, interpolate)
        matching.check()
        stray = [text for text in tracks if recordings_in(Path(text))]
        folders = recordings_of([*recordings, *stray])
        like = TracksSource(Path(), columns_of(columns), matching)
        files = files_of([text for text in tracks if text not in stray])
        pairs = paired(files, folders, like)
        return cls(folders, {folder: [like._replace(path=f) for f in own] for folder, own in pairs.items()})

    def named(self, name: str | None) -> tuple[tuple[str, TracksSource], ...]:
        """The files of the one recording, each with the name given, of several what they are called beside it."""
        ((folder, own),) = self.tracks.items()
        called = (source.path.stem.removeprefix(folder.resolve().name).strip("_-.") or TRACKS.name for source in own)
        return tuple((name if name and len(own) == 1 else stem, file) for stem, file in zip(called, own, strict=True))

    @property
    def each(self) -> dict[Path, TracksSource]:
        """The file of each recording that has one; ValueError where one has two."""
        if twice := [own for own in self.tracks.values() if len(own) > 1]:
            both = f"{twice[0][0].path} and {twice[0][1].path}"
            raise ValueError(f"tracks: {both} are of one recording; compare them by --tracks NAME=PATTERN")
        return {folder: own[0] for folder, own in self.tracks.items() if own}


def recordings_in(path: Path) -> list[Path]:
    """The folder itself if it is a recording, else those in it; none where it is no folder of either."""
    if not path.is_dir():
        return []
    if path_of(path, DETECTIONS.name) is not None:
        return [path]
    return sorted(inner for inner in path.iterdir() if inner.is_dir() and path_of(inner, DETECTIONS.name) is not None)


def recordings_of(texts: Sequence[str]) -> list[Path]:
    """The recordings of folders, folders of folders, and patterns such as `drives/*`.

    Raises ValueError, in one sentence, for a text that gives none, or where two have one name.
    """
    found: list[Path] = []
    for text in texts:
        inside = [one for path in _matches(text) for one in recordings_in(path)]
        if not inside:
            raise ValueError(f"recording: {text!r} is no recording and has none; give the folder of its tables")
        found += inside
    return _different(found, "recordings")


def files_of(texts: Sequence[str]) -> list[Path]:
    """The files of tracks of paths, folders and patterns such as `tracks/*.csv`; ValueError as in `recordings_of`."""
    found: list[Path] = []
    for text in texts:
        paths = _matches(text)
        files = [f for p in paths for f in (sorted(p.iterdir()) if p.is_dir() else [p]) if f.suffix in SUFFIXES]
        if not files:
            raise ValueError(f"tracks: {text!r} gives no file {' or '.join(SUFFIXES)}; correct the path")
        found += files
    return list(dict.fromkeys(found))


def _matches(text: str) -> list[Path]:
    """What a path or a pattern stands for."""
    try:
        there = Path(text).exists()
        return [Path(found) for found in sorted(glob(escape(text) if there else text))]
    except (ValueError, OSError) as error:
        raise ValueError(f"{text[:60]!r} is no path ({error}); correct it") from None


def _different(found: Sequence[Path], what: str) -> list[Path]:
    different = list({path.resolve(): path for path in found}.values())
    names = [path.resolve().name for path in different]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"{what} must have different names, two are called {twice[0]!r}; rename a folder")
    return different


def paired(files: Sequence[Path], recordings: Sequence[Path], source: TracksSource) -> dict[Path, list[Path]]:
    """The files of each recording: by name, the longest that the file or its folder begins with, else by time.

    Raises ValueError, in one sentence, for a file that is of none or of several.
    """
    found: dict[Path, list[Path]] = {recording: [] for recording in recordings}
    for file in files:
        if len(recordings) == 1:
            found[recordings[0]].append(file)
            continue
        by_name = [r for r in recordings if _is_called(file, r.resolve().name)]
        fit = sorted(by_name, key=lambda r: -len(r.resolve().name))[:1] or _at_time(file, recordings, source)
        if len(fit) != 1:
            several = f"its times fit {len(fit)} recordings" if fit else "it fits none by name or time"
            raise ValueError(f"tracks: of which recording is {file}? {several}; begin its name with the recording's")
        found[fit[0]].append(file)
    return found


def _is_called(file: Path, name: str) -> bool:
    """Whether a file has the name of a recording, or begins with it, or lies in a folder of that name."""
    rest = file.stem.removeprefix(name)
    own = file.stem.startswith(name) and not rest[:1].isalnum()
    return own or file.resolve().parent.name == name


def _at_time(file: Path, recordings: Sequence[Path], source: TracksSource) -> list[Path]:
    """The recordings with scans at the median time of a file."""
    time = read_file(file, TRACKS, {other: name for name, other in source.columns})["time"]
    if not len(time):
        return []
    middle = float(np.median(time))
    spans = ((r, read_table(r, DETECTIONS)) for r in recordings)
    return [r for r, t in spans if t is not None and t.rows and t["time"].min() <= middle <= t["time"].max()]
