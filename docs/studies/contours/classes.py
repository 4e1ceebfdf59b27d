"""How soon after birth the class of a track is right, over recordings of all scenarios."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.tracking import Evaluator
from testbed.frame import Frame
from testbed.log.text import markdown_table
from trackers import find
from trackers.filter import Abilities

AGES = (0.5, 1.0, 2.0, 4.0, 8.0)  # [s]
SURE = 0.9


class ClassHistory(NamedTuple):
    """The class probabilities of one track while it was on one vehicle, n frames."""

    kind: str  # the truth
    age: NDArray  # (n,) [s] of the track
    probability: NDArray  # (n, C)


class ClassProbe:
    """Observer of a replay that keeps the class probabilities of tracks on vehicles that count."""

    def __init__(self, tracker: str) -> None:
        can = Abilities.of(find(tracker))
        if not can.has("classes", "learn_where", "class_size"):
            raise ValueError(f"tracker {tracker} has no classes; take one such as pmht-spline-adaptive")
        self.tracker, self.classes = tracker, can.classes or ()
        self._evaluator = Evaluator(tracker)
        self._rows: dict[tuple[int, int, str], list[tuple[float, NDArray]]] = {}

    def __call__(self, frame: Frame) -> None:
        """Keep the class probabilities of one frame."""
        scene, (tracks, _) = frame.scene, frame.outputs[self.tracker]
        probability = tracks.estimate.class_probability
        assert probability is not None
        score = self._evaluator.step(frame.time, scene, frame.origin, tracks)
        kinds = dict(zip(scene.objects.id.tolist(), scene.objects.kind, strict=True))
        index = {number: i for i, number in enumerate(tracks.id.tolist())}
        for number, track in score.pairs.items():
            if number in score.counted and kinds[number] in self.classes:
                i = index[track]
                row = (float(tracks.age[i]), probability[i])
                self._rows.setdefault((number, track, kinds[number]), []).append(row)

    @property
    def histories(self) -> list[ClassHistory]:
        """One for each vehicle and track on it."""
        found = []
        for (_, _, kind), rows in self._rows.items():
            age, p = zip(*rows, strict=True)
            found.append(ClassHistory(kind, np.array(age), np.array(p)))
        return found


def at_age(histories: Sequence[ClassHistory], age: float) -> NDArray:
    """Probabilities (S, C) at an age [s], of the tracks that reached it."""
    rows = [h.probability[np.searchsorted(h.age, age)] for h in histories if h.age[0] <= age <= h.age[-1]]
    return np.array(rows)


def right_since(history: ClassHistory, classes: Sequence[str]) -> float:
    """Age [s] since which the true class has been the most probable one; infinite where it is not at the end."""
    right = history.probability.argmax(-1) == classes.index(history.kind)
    wrong = np.flatnonzero(~right)
    first = 0 if not len(wrong) else int(wrong[-1]) + 1
    return float(history.age[first]) if first < len(right) else np.inf


def _by_class(histories: Sequence[ClassHistory], classes: Sequence[str]) -> Mapping[str, list[ClassHistory]]:
    return {name: found for name in classes if (found := [h for h in histories if h.kind == name])}


def delay_table(histories: Sequence[ClassHistory], classes: Sequence[str]) -> str:
    """One row a true class: right at each age, and since when."""
    rows = []
    for name, own in _by_class(histories, classes).items():
        k, cells = classes.index(name), [name, str(len(own))]
        for age in AGES:
            p = at_age(own, age)
            cells.append(f"{np.mean(p.argmax(-1) == k):.0%} of {len(p)}" if len(p) else "–")
        since = np.array([right_since(h, classes) for h in own])
        median = np.median(since)
        cells += [f"{median:.1f}" if np.isfinite(median) else "never", f"{np.mean(np.isfinite(since)):.0%}"]
        rows.append(tuple(cells))
    return markdown_table(
        ("true class", "tracks", *(f"right at {age:g} s" for age in AGES), "right since, median [s]", "at the end"),
        rows,
    )


def confusion_table(histories: Sequence[ClassHistory], classes: Sequence[str]) -> str:
    """One row a true class: shares [%] of the most probable classes at the end, mean probability of the truth."""
    rows = []
    for name, own in _by_class(histories, classes).items():
        last = np.array([h.probability[-1] for h in own])
        share = np.bincount(last.argmax(-1), minlength=len(classes)) / len(own)
        rows.append((name, *(f"{100 * x:.0f}" for x in share), f"{last[:, classes.index(name)].mean():.2f}"))
    return markdown_table(("true class", *(f"{name} [%]" for name in classes), "mean probability of the truth"), rows)


def calibration(histories: Sequence[ClassHistory], classes: Sequence[str]) -> tuple[float, float]:
    """Share of the frames in which a class has a probability above `SURE`, and share of these that are right."""
    p = np.concatenate([h.probability for h in histories])
    kind = np.concatenate([np.full(len(h.age), classes.index(h.kind)) for h in histories])
    sure = p.max(-1) > SURE
    return float(sure.mean()), float((p.argmax(-1) == kind)[sure].mean()) if sure.any() else np.nan
