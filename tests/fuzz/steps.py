"""Drives a filter or a multi-object tracker through hostile scans and counts what every step came to."""

import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors import RADARS
from tests.fuzz.hostile_scans import CARS, USUAL, Car, clean, malformed, spoil, time_step, together
from trackers import Estimate, Filter, MultiObjectTracker, Scan, prior

ARGUMENTS = ("scan.", "dt")  # an error names one of these
NUMBERS = ("pose", "velocity", "yaw_rate", "size", "cov", "size_std", "heading_std", "yaw_rate_std")
ERRORS = (ArithmeticError, AssertionError, AttributeError, LookupError, RuntimeError, TypeError, ValueError)
REFUSED, KEPT, DONE = "refused by name", "done, the prediction kept", "done"


class Tally(NamedTuple):
    """What the steps came to: clear answers, and wrong ones with an example of each kind."""

    clear: Counter[str]
    wrong: Counter[str]
    examples: dict[str, str]

    @classmethod
    def empty(cls) -> "Tally":
        """Before the first step."""
        return cls(Counter(), Counter(), {})

    @property
    def tried(self) -> int:
        """Number of steps."""
        return self.clear.total() + self.wrong.total()

    def plus(self, *others: "Tally") -> "Tally":
        """The sum of several, with the first example of each kind."""
        tallies = (self, *others)
        examples = {kind: text for tally in reversed(tallies) for kind, text in tally.examples.items()}
        return Tally(sum((t.clear for t in tallies), Counter()), sum((t.wrong for t in tallies), Counter()), examples)

    def __str__(self) -> str:
        kinds = ", ".join(f"{n} {kind} ({self.examples[kind]})" for kind, n in self.wrong.most_common()) or "none"
        return f"{self.tried} steps, {self.clear.total()} clear {dict(self.clear)}, wrong: {kinds}"


def arrays(value: Any) -> list[NDArray]:
    """All arrays of a state."""
    if value is None:
        return []
    return [a for v in value for a in arrays(v)] if isinstance(value, tuple) else [np.asarray(value)]


def definite(C: NDArray) -> bool:
    """Whether covariances (..., n, n) are positive definite, in their own units and in units of their deviations."""
    std = np.sqrt(np.maximum(C.diagonal(axis1=-2, axis2=-1), 0.0))
    if not ((std > 0).all() and (np.linalg.eigvalsh(C) > 0).all()):
        return False
    return bool((np.linalg.eigvalsh(C / std[..., :, None] / std[..., None, :]) > 0).all())


def fault(state: Any, estimate: Estimate) -> str | None:
    """What is wrong with a state and its estimate, None where nothing is."""
    if not all(np.isfinite(a).all() for a in arrays(state)):
        return "state not finite"
    if not all(np.isfinite(getattr(estimate, name)).all() for name in NUMBERS):
        return "estimate not finite"
    if not definite(estimate.cov):
        return "covariance indefinite"
    if not all((getattr(estimate, name) > 0).all() for name in ("size", "size_std", "heading_std", "yaw_rate_std")):
        return "size or standard deviation not positive"
    return None


def attempt(
    tally: Tally, where: str, step: Callable[..., Any], given: tuple, check: Callable[[Any], str | None]
) -> Any:
    """What step(*given) returns, None where it gave nothing that can be used; counted in the tally."""
    before = [np.array(a) for a in arrays(given)]
    found, wrong = None, None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the numbers are checked instead
            found = step(*given)
            wrong = check(found)
    except ERRORS as error:
        named = type(error) is ValueError and any(name in str(error) for name in ARGUMENTS)
        wrong = None if named else f"{type(error).__name__}: {error}"
    if any(a.tobytes() != b.tobytes() for a, b in zip(before, arrays(given), strict=True)):
        wrong = "changed what it was given"
    if wrong is None:
        tally.clear[REFUSED if found is None else KEPT if kept(found) else DONE] += 1
        return found
    kind = wrong.partition(":")[0]
    tally.wrong[kind] += 1
    tally.examples.setdefault(kind, f"{where}: {wrong}")
    return None


def kept(found: Any) -> bool:
    """Whether the information of an update, or the events of a step, say that a prediction was kept."""
    info = found[1] if type(found) is tuple else None
    return any(note.kind == "skipped" for note in getattr(info, "notes", ()) or getattr(info, "events", ()))


def hostile(rng: np.random.Generator, cars: Sequence[Car], time: float, seed: int) -> Scan:
    """A scan of the cars at a time [s]; spoilt are three of ten, or nine where the seed is odd."""
    scan = clean(rng, [car.at(time) for car in cars])
    return spoil(scan, rng) if rng.random() < (0.9 if seed % 2 else 0.3) else scan


def sometimes_malformed(scan: Scan, rng: np.random.Generator) -> Scan:
    """The scan, one of thirty malformed."""
    return malformed(scan, rng) if rng.random() < 1 / 30 else scan


def drive_filter(filter: Filter, seed: int, steps: int) -> Tally:
    """Predictions and updates of two objects, the scans of the first hostile; after a wrong answer they start again."""
    rng, tally, state, wrong = np.random.default_rng([7, seed]), Tally.empty(), None, 0
    for k in range(steps):
        time, dt = k * USUAL, time_step(rng)
        scan = together([hostile(rng, CARS[:1], time, seed), clean(rng, [CARS[1].at(time)])])
        scan = sometimes_malformed(scan, rng)
        if state is None or tally.wrong.total() > wrong:
            state = filter.init(prior([car.at(time)[:3] for car in CARS[:2]], velocity=(24.0, 0.0)))
            wrong = tally.wrong.total()
        where = f"seed {seed}, step {k}"
        moved = attempt(tally, f"{where}, predict", filter.predict, (state, dt), lambda s: fault(s, filter.estimate(s)))
        state = state if moved is None else moved
        found = attempt(
            tally, f"{where}, update", filter.update, (state, scan), lambda s: fault(s[0], filter.estimate(s[0]))
        )
        state = state if found is None else found[0]
    return tally


def drive_tracker(filter: Filter, seed: int, steps: int) -> Tally:
    """Steps of a multi-object tracker over the filter, three cars in view; after a wrong answer it starts again."""
    rng, tally, tracks, wrong = np.random.default_rng([8, seed]), Tally.empty(), None, 0
    tracker = MultiObjectTracker(filter, RADARS["front"].models)

    def check(found: Any) -> str | None:
        existence = found[0].existence
        if not ((existence >= 0) & (existence <= 1)).all():
            return "existence is no probability"
        return fault(found[0].state, found[0].estimate)

    for k in range(steps):
        dt, scan = time_step(rng), sometimes_malformed(hostile(rng, CARS, k * USUAL, seed), rng)
        if tracks is None or tally.wrong.total() > wrong:
            tracks, wrong = tracker.start(), tally.wrong.total()
        found = attempt(tally, f"seed {seed}, step {k}", tracker.step, (tracks, scan, dt), check)
        tracks = tracks if found is None else found[0]
    return tally
