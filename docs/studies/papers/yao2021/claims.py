"""What yao2021 claims, and our answers; docs/reproductions.md has the figures."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from studies.papers.answer import Answer, Claim, every, judge
from testbed.evaluation.intervals import Interval

StageSquares = Mapping[str, Mapping[str, NDArray]]  # stage -> column -> mean squared errors (R,) of the runs
Squares = Mapping[tuple[str, str], StageSquares]  # contour, method
CONTOURS = ("truck", "tractor")
MOTION = {"position m": "position", "speed m/s": "speed", "heading rad": "heading"}
EXTENT = {"length m": "length", "width m": "width"}
MUCH = 1.3  # times smaller, what counts as much improved
ALIKE = 1.3  # times, within which two gains are comparable
DRAWS = 400  # of the bootstrap


def gain(before: NDArray, after: NDArray) -> Interval:
    """How many times smaller an RMSE is after than before, from mean squared errors (R,) of the same runs.

    The interval is that of the bootstrap over the runs.
    """
    pick = np.random.default_rng(0).integers(len(before), size=(DRAWS, len(before)))
    ratio = np.sqrt(before[pick].mean(-1) / np.maximum(after[pick].mean(-1), 1e-300))
    value = float(np.sqrt(before.mean() / max(after.mean(), 1e-300)))
    return Interval(value, *(float(q) for q in np.quantile(ratio, [0.025, 0.975])))


def text(g: Interval) -> str:
    """A gain with its interval as people read it."""
    return f"{g.value:.2f} [{g.low:.2f}, {g.high:.2f}]"


def above(g: Interval, bar: float) -> bool | None:
    """Whether a gain is above a bar; None where its interval holds the bar."""
    return None if bar in g else g.value > bar


def apart(a: Interval, b: Interval) -> Interval:
    """How many times one gain is the other, at least 1; the runs of the two are independent, and logs add up."""
    value = max(a.value, b.value) / min(a.value, b.value)
    width = float(np.exp(np.hypot(*(np.log(g.high / g.low) / 2 for g in (a, b)))))
    return Interval(value, value / width, value * width)


def gains(squares: Squares) -> Iterator[tuple[str, Interval, Interval]]:
    """Method and column in words, and the gains of truck and tractor by the adaptation."""
    for method in ("A", "A, 4 Sigma", "B"):
        for column, word in MOTION.items():
            stages = [squares[name, method] for name in CONTOURS]
            truck, tractor = (gain(s["not adapted"][column], s["adapted"][column]) for s in stages)
            yield f"{method}, {word}", truck, tractor


def answers(squares: Squares) -> tuple[Answer, ...]:
    """An answer to every claim."""
    return smoother(squares), adaptation(squares), comparable(squares), ours(squares)


def smoother(squares: Squares) -> Answer:
    """Section IV: errors of smoothed states against those of filtered ones."""
    held: dict[str, bool | None] = {}
    numbers = []
    for name in CONTOURS:
        s = squares[name, "A"]
        for column, word in (MOTION | EXTENT).items():
            g = gain(s["before"][column], s["smoothed"][column])
            held[f"{name}, {word}"] = above(g, 1.0)
            numbers.append(f"{name}, {word} {text(g)}")
    claim = Claim("The smoother often improves on the filter before the adaptation", "section IV, Fig. 7 and 8")
    return judge(claim, held, f"RMSE filtered over smoothed: {'; '.join(numbers)}")


def adaptation(squares: Squares) -> Answer:
    """Section IV: errors with the adapted contour against those without."""
    held: dict[str, bool | None] = {}
    numbers = []
    for what, truck, tractor in gains(squares):
        held[what] = every([above(truck, MUCH), above(tractor, MUCH)])
        numbers.append(f"{what} {text(truck)} / {text(tractor)}")
    claim = Claim("The RMSE is much improved after the adaptation", "section IV, Fig. 7")
    return judge(claim, held, f"RMSE without over with, truck / tractor; much: above {MUCH}: {'; '.join(numbers)}")


def comparable(squares: Squares) -> Answer:
    """Section IV: gain of the truck against that of the tractor."""
    held: dict[str, bool | None] = {}
    numbers = []
    for what, truck, tractor in gains(squares):
        factor = apart(truck, tractor)
        unlike = above(factor, ALIKE)
        held[what] = None if unlike is None else not unlike
        numbers.append(f"{what} {text(factor)}")
    claim = Claim("The gains of truck and tractor are comparable", "section IV")
    return judge(claim, held, f"larger gain over smaller, alike: below {ALIKE}: {'; '.join(numbers)}")


def ours(squares: Squares) -> Answer:
    """Position errors with our shift of the frame against those without."""
    pairs = {
        name: gain(squares[name, "A"]["adapted"]["position m"], squares[name, "B"]["adapted"]["position m"])
        for name in CONTOURS
    }
    claim = Claim("With the frame moved to the middle of the contour position errors are 40 % less", "ours")
    numbers = ", ".join(f"{name} {text(g)}" for name, g in pairs.items())
    return judge(claim, {name: above(g, 1 / 0.6) for name, g in pairs.items()}, f"RMSE of A over B, adapted: {numbers}")
