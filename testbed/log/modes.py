"""Motion models and classes in the log: their names, and probabilities where a tracker mixes several models."""

from collections.abc import Mapping, Sequence

from numpy.typing import NDArray

from trackers import TRACKERS
from trackers.multi.tracks import StepInfo

Modes = Mapping[str, tuple[str, ...]]  # tracker -> names of its motion models, none where it has one only


def mode_names(tracker: str) -> tuple[str, ...]:
    """Names of the motion models that a tracker of the table mixes; none where it has one, or is not in the table."""
    if tracker not in TRACKERS:
        return ()
    filter = TRACKERS[tracker].filter
    names: tuple[object, ...] = getattr(filter, "modes", getattr(filter, "models", ()))
    named = tuple(name for name in names if isinstance(name, str))  # `models` of a spline filter are contours
    return named if len(named) > 1 else ()


def class_names(tracker: str) -> tuple[str, ...]:
    """Names of the classes between which a tracker of the table decides; none where it does not classify."""
    return getattr(TRACKERS[tracker].filter, "classes", ()) if tracker in TRACKERS else ()


def modes_of(trackers: Sequence[str]) -> Modes:
    """Names for all trackers of a run."""
    return {tracker: mode_names(tracker) for tracker in trackers}


def probabilities(info: StepInfo, names: Sequence[str]) -> dict[int, NDArray]:
    """Track id -> probabilities (K,) of the named models; nothing at a scan without any detection on a track."""
    mode = info.mode
    if mode is None or not names or mode.shape[-1] != len(names):
        return {}
    return dict(zip(info.track.tolist(), mode, strict=True))
