"""What a frame costs with the scenarios, radars and trackers that a user names."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import islice, product
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

from rich.markup import escape
from rich.table import Table

from testbed.bench import PLANNER, Progress
from testbed.command_line.tables import light_table
from testbed.environment.episode import decisions as decisions_of
from testbed.environment.episode import start
from testbed.environment.perception import Perception
from testbed.environment.registration import make, scenario_of
from testbed.planners import find as find_planner
from trackers import DEFAULT

SECONDS = 10  # simulated, of each scenario
QUICK = 3


class Choice(NamedTuple):
    """What is measured, by names as `testbed run` takes them; every scenario is driven with every radar."""

    scenarios: Sequence[str]
    trackers: Sequence[str]
    radars: Sequence[str]
    seconds: int = SECONDS

    @classmethod
    def of(
        cls, scenarios: Sequence[str] | None, trackers: Sequence[str] | None, radars: Sequence[str] | None, quick: bool
    ) -> "Choice":
        """What was named, with the defaults of `testbed run` for the rest."""
        seconds = QUICK if quick else SECONDS
        return cls(scenarios or ["cut-in"], trackers or [DEFAULT], radars or ["surround"], seconds)

    def check(self) -> None:
        """Raise LookupError or ValueError, in one sentence, for what cannot be run."""
        for scenario, radar in product(self.scenarios, self.radars):
            scenario_of(scenario)
            Perception.mount(radar, self.trackers)


class Spent(NamedTuple):
    """Wall time [s] of one decision, or until now."""

    radar: float
    trackers: tuple[float, ...]
    simulation: float  # with planner and observation


def measure(choice: Choice, progress: Progress) -> list[Table]:
    """A table a scenario and radar; progress(done, total, name) before each."""
    tables = []
    cases = list(product(choice.scenarios, choice.radars))
    first, *others = choice.trackers
    for k, (scenario, radar) in enumerate(cases):
        progress(k, len(cases), scenario)
        with closing(make(scenario, tracker=first, also=others, radar=radar, log="off", metrics=False)) as env:
            config = env.unwrapped.config  # type: ignore[attr-defined]
            spent = list(decisions(env, choice.seconds))
        title = f"{scenario}, radar {radar}"
        tables.append(table(title, choice.trackers, spent, config["simulation_frequency"] / config["policy_frequency"]))
    progress(len(cases), len(cases), "done")
    return tables


def decisions(env: Any, seconds: int) -> Iterator[Spent]:
    """What each decision of so many simulated seconds took; an episode that ends earlier is followed by the next."""
    planner, seed = find_planner(PLANNER), 0
    left = seconds * env.unwrapped.config["policy_frequency"]
    while left > 0:
        start(env, planner, seed)
        before, begun = _spent(env), perf_counter()
        for _ in islice(decisions_of(env, planner), left):
            wall, after = perf_counter() - begun, _spent(env)
            radar = after.radar - before.radar
            trackers = tuple(b - a for a, b in zip(before.trackers, after.trackers, strict=True))
            yield Spent(radar, trackers, wall - radar - sum(trackers))
            left -= 1
            before, begun = _spent(env), perf_counter()
        seed += 1


def table(title: str, trackers: Sequence[str], spent: Sequence[Spent], frames: float) -> Table:
    """Medians over the decisions, a frame; ratios are medians of the ratios of one decision, on the same scans."""
    shown = light_table(f"{title}: wall time a frame, medians of {len(spent)} decisions")
    for head in ("", "[ms]", f"times {trackers[0]}", "times the simulation"):
        shown.add_column(escape(head), justify="right" if head else "left")
    parts = [(name, [s.trackers[k] for s in spent]) for k, name in enumerate(trackers)]
    first, simulation = parts[0][1], [s.simulation for s in spent]
    for name, times in [*parts, ("scene and radar", [s.radar for s in spent]), ("simulation, planner", simulation)]:
        shown.add_row(
            escape(name), f"{1e3 * median(times) / frames:.2f}", _ratio(times, first), _ratio(times, simulation)
        )
    return shown


def _ratio(times: Sequence[float], others: Sequence[float]) -> str:
    return f"{median(a / b for a, b in zip(times, others, strict=True)):.2f}"


def _spent(env: Any) -> Spent:
    """Wall time so far of what is measured by itself."""
    return Spent(env.seconds["sense"], tuple(cost.seconds for cost in env.costs.values()), 0.0)
