"""Motion models in the log: their names, and probabilities where a tracker mixes several models."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from trackers import TRACKERS, SensorModel, build
from trackers.multi.tracks import StepInfo

Modes = Mapping[str, tuple[str, ...]]  # tracker -> names of its motion models, none where it has one only


def mode_names(tracker: str) -> tuple[str, ...]:
    """Names of the motion models that a tracker of the table mixes; none where it has one, or is not in the table."""
    for filter in _layers(tracker):
        names: tuple[object, ...] = getattr(filter, "modes", getattr(filter, "models", ()))
        named = tuple(name for name in names if isinstance(name, str))  # `models` of a spline filter are contours
        if len(named) > 1:
            return named
    return ()


def _layers(tracker: str) -> Iterator[Any]:
    """The filter of a tracker of the table, `NAME` or `NAME:key=value`, then that of the place if it is composed."""
    if tracker.partition(":")[0] not in TRACKERS:
        return
    filter: Any = build(tracker, (SensorModel(),)).filter
    while filter is not None:
        yield filter
        filter = getattr(filter, "place", None)


def modes_of(trackers: Sequence[str]) -> Modes:
    """Names for all trackers of a run."""
    return {tracker: mode_names(tracker) for tracker in trackers}


def probabilities(info: StepInfo, names: Sequence[str]) -> dict[int, NDArray]:
    """Track id -> probabilities (K,) of the named models; nothing at a scan without any detection on a track."""
    mode = info.mode
    if mode is None or not names or mode.shape[-1] != len(names):
        return {}
    return dict(zip(info.track.tolist(), mode, strict=True))
