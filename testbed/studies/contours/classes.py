"""How soon after birth the class of a track is right, over recorded drives of all scenarios."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import Origin
from sensors.scene import Scene
from testbed.evaluation.tracking import Evaluator
from testbed.frame import Outputs
from testbed.log.text import markdown_table
from trackers import find
from trackers.protocols import Classifying
from trackers.scan import Scan

AGES = (0.5, 1.0, 2.0, 4.0, 8.0)  # [s]
SURE = 0.9


class Story(NamedTuple):
    """What a track said about the class of one vehicle, n looks."""

    kind: str  # the truth
    age: NDArray  # (n,) [s] of the track
    probability: NDArray  # (n, C)


class ClassProbe:
    """Observer of a replay that keeps what tracks say about the classes of the vehicles that they follow."""

    def __init__(self, tracker: str) -> None:
        filter = find(tracker)
        if not isinstance(filter, Classifying):
            raise ValueError(f"tracker {tracker} does not tell classes; take one such as pmht-spline-adaptive")
        self.tracker, self.classes = tracker, filter.classes
        self._evaluator = Evaluator(tracker)
        self._rows: dict[tuple[int, int, str], list[tuple[float, NDArray]]] = {}

    def __call__(
        self, step: int, time: float, scene: Scene, scan: Scan, origin: Origin, outputs: Outputs, *drive: object
    ) -> None:
        """Take in one look."""
        tracks, _ = outputs[self.tracker]
        probability = tracks.estimate.class_probability
        assert probability is not None
        score = self._evaluator.step(time, scene, origin, tracks)
        kinds = dict(zip(scene.objects.id.tolist(), scene.objects.kind, strict=True))
        row = {number: i for i, number in enumerate(tracks.id.tolist())}
        for number, track in score.pairs.items():
            if number in score.counted and kinds[number] in self.classes:
                i = row[track]
                told = (float(tracks.age[i]), probability[i])
                self._rows.setdefault((number, track, kinds[number]), []).append(told)

    @property
    def stories(self) -> list[Story]:
        """One for each vehicle and track on it."""
        found = []
        for (_, _, kind), rows in self._rows.items():
            age, p = zip(*rows, strict=True)
            found.append(Story(kind, np.array(age), np.array(p)))
        return found


def at_age(stories: Sequence[Story], age: float) -> NDArray:
    """Probabilities (S, C) at an age [s] of the tracks that became so old."""
    rows = [s.probability[np.searchsorted(s.age, age)] for s in stories if s.age[0] <= age <= s.age[-1]]
    return np.array(rows)


def right_since(story: Story, classes: Sequence[str]) -> float:
    """Age [s] since which the true class has been the most probable one; infinite where it is not at the end."""
    right = story.probability.argmax(-1) == classes.index(story.kind)
    wrong = np.flatnonzero(~right)
    first = 0 if not len(wrong) else int(wrong[-1]) + 1
    return float(story.age[first]) if first < len(right) else np.inf


def _by_class(stories: Sequence[Story], classes: Sequence[str]) -> Mapping[str, list[Story]]:
    return {name: found for name in classes if (found := [s for s in stories if s.kind == name])}


def delay_table(stories: Sequence[Story], classes: Sequence[str]) -> str:
    """One row a true class: right at each age, and since when."""
    rows = []
    for name, own in _by_class(stories, classes).items():
        k, cells = classes.index(name), [name, str(len(own))]
        for age in AGES:
            p = at_age(own, age)
            cells.append(f"{np.mean(p.argmax(-1) == k):.0%} of {len(p)}" if len(p) else "–")
        since = np.array([right_since(s, classes) for s in own])
        median = np.median(since)
        cells += [f"{median:.1f}" if np.isfinite(median) else "never", f"{np.mean(np.isfinite(since)):.0%}"]
        rows.append(tuple(cells))
    return markdown_table(
        ("true class", "tracks", *(f"right at {age:g} s" for age in AGES), "right since, median [s]", "at the end"),
        rows,
    )


def confusion_table(stories: Sequence[Story], classes: Sequence[str]) -> str:
    """One row a true class: share [%] of the tracks whose most probable class is this one at their end, mean belief."""
    rows = []
    for name, own in _by_class(stories, classes).items():
        last = np.array([s.probability[-1] for s in own])
        share = np.bincount(last.argmax(-1), minlength=len(classes)) / len(own)
        rows.append((name, *(f"{100 * x:.0f}" for x in share), f"{last[:, classes.index(name)].mean():.2f}"))
    return markdown_table(("true class", *(f"{name} [%]" for name in classes), "mean probability of the truth"), rows)


def calibration(stories: Sequence[Story], classes: Sequence[str]) -> tuple[float, float]:
    """Share of the looks at which a class is sure, above `SURE`, and share of these that are right."""
    p = np.concatenate([s.probability for s in stories])
    kind = np.concatenate([np.full(len(s.age), classes.index(s.kind)) for s in stories])
    sure = p.max(-1) > SURE
    return float(sure.mean()), float((p.argmax(-1) == kind)[sure].mean()) if sure.any() else np.nan
