"""What the statistics of a study say, in sentences; their wording is in `templates/sentences.md`."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from testbed.command_line.tables import number
from testbed.environment.sources.substitution import GROUP_NAMES, GROUPS
from testbed.evaluation.intervals import FEWEST
from testbed.evaluation.metric import METRICS
from testbed.experiments.pairs import Attribution, Correlation
from testbed.experiments.pairs import Cell as PairCell
from testbed.experiments.report.grid import bounds
from testbed.experiments.report.tables import order
from testbed.experiments.report.texts import say
from testbed.experiments.statistics import MAIN, PHASES, Cell, Change, compare, samples
from testbed.experiments.store import Results

BESIDES = tuple(key for key in MAIN if key != "gospa")
RISK, LOSS = "tit", "progress"  # the metrics of either side that tell trackers apart with the fewest seeds
MANY = 20  # intervals, of which one leaves out zero by chance
AGAINST = {"better": "better", "worse": "worse", "unresolved": "not resolved", "the same": "the same",
           "too few seeds": "too few seeds to judge"}  # fmt: skip
SMALL = 0.001  # differences of scores that are none
MINUS = " minus "  # between two trackers that are compared


class Reach(NamedTuple):
    """How many finished runs have scans in a phase of the maneuver."""

    phase: str
    reached: int
    runs: int

    @property
    def text(self) -> str:
        """The count in words."""
        return say("reach", **self._asdict())


def reach(results: Results) -> list[Reach]:
    """The four phases in their order; a run that has no scan in a phase does not reach it."""
    spans, runs = results.spans, len(results.runs)
    if not runs:
        return []
    scanned = spans[spans["gospa"].notna()] if "gospa" in spans else spans
    return [Reach(phase, int((scanned["phase"] == phase).sum()), runs) for phase in PHASES]


def few_seeds(runs: pd.DataFrame, strata: Sequence[str], planned: int) -> list[str]:
    """A sentence where no stratum of these columns has as many seeds as an interval needs."""
    seeds = planned if runs.empty else int(runs.groupby(list(strata))["seed"].nunique().max())
    return [say("few seeds", seeds=seeds, fewest=FEWEST)] if seeds < FEWEST else []


def verdict(results: Results, cells: Sequence[Cell]) -> list[str]:
    """Best in GOSPA and whether that is resolved, the others against the reference, then the other measures."""
    ranked = order(cells)
    if not ranked:
        return [say("nothing to compare")]
    sentences = [_best(results, ranked)]
    if len(ranked) > 1:
        sentences += [_lead(results, ranked), _wins(results, ranked[0].tracker), _against(cells, results)]
    sentences += [_besides(cells), _certainty(cells), _cost(results, ranked[0].tracker)]
    return [s for s in sentences if s]


def caveats(results: Results, cells: Sequence[Cell]) -> list[str]:
    """What a reader should know before using the tables."""
    found = few_seeds(results.runs, ["tracker", "scenario"], len(results.study.seeds))
    found += _lacking(results, cells)
    if empty := [phase.text for phase in reach(results) if not phase.reached]:
        found.append(say("unreached", phases=empty))
    count = sum(c.difference is not None and np.isfinite(c.difference.mean.low) for c in cells)
    if count >= MANY:
        found.append(say("many intervals", count=count, chance=f"{count / MANY:.0f}"))
    return found


def unresolved(cells: Sequence[Cell]) -> list[str]:
    """One sentence for each difference to the reference that the seeds cannot resolve, with how many it would take."""
    known = [(cell, cell.difference) for cell in cells if cell.difference is not None]
    found = [_open(f"{c.tracker}, {METRICS[c.measure].label}", d, d.verdict, "run") for c, d in known]
    return [sentence for sentence in found if sentence]


def unresolved_pairs(cells: Sequence[PairCell]) -> list[str]:
    """The same for changes of drives."""
    where = [f"{c.condition}, {c.planner}, {c.scenario}, {METRICS[c.measure].label}" for c in cells]
    found = [_open(text, c.change, c.verdict, "seed") for text, c in zip(where, cells, strict=True)]
    return [sentence for sentence in found if sentence]


def _open(where: str, change: Change, verdict: str, unit: str) -> str:
    """What is not known of a change; nothing where it is resolved."""
    if verdict not in ("unresolved", "too few seeds"):
        return ""
    seeds = f"{change.needed:.0f}" if np.isfinite(change.needed) else ""
    values = {"where": where, "unit": unit, "pairs": change.pairs, "needed": seeds}
    return say(verdict, change=f"{change.mean.value:+.3g}", **values)


def one_sided(found: Sequence[PairCell]) -> list[str]:
    """Sentences about conditions that look safer than the reference and pay with progress, or the other way round."""
    by_key = {(c.scenario, c.planner, c.condition, c.measure): c for c in found}
    sentences = []
    for (scenario, planner, condition, measure), cell in by_key.items():
        other = by_key.get((scenario, planner, condition, LOSS))
        if measure == RISK and other is not None and {cell.verdict, other.verdict} == {"better", "worse"}:
            where, sides = f"{condition}, {planner}, {scenario}", [_moved(cell), _moved(other)]
            sentences.append(say("one-sided", where=where, safer=cell.verdict == "better", sides=sides))
    return sentences


def _moved(cell: PairCell) -> str:
    metric = METRICS[cell.measure]
    return f"{metric.label} {cell.change.mean.value:+.3g} {metric.unit}"


def _lacking(results: Results, cells: Sequence[Cell]) -> list[str]:
    """Sentences for the trackers that lack the same number of runs, and for those that have runs, but no tracks."""
    study = results.study
    each, alike = len(study.scenarios) * len(study.seeds), dict[int, list[str]]()
    for tracker in study.trackers:
        alike.setdefault(sum(run.source == tracker for run in results.missing), []).append(tracker)
    said = [
        say("no run" if count == each else "some runs", trackers=names, count=count, each=each)
        for count, names in alike.items()
        if count
    ]
    seeing = {c.tracker for c in cells if c.measure == "rmse_position" and np.isfinite(c.mean.value)}
    blind = [t for t in study.trackers if t not in seeing and t not in alike.get(each, [])]
    return [*said, say("blind", trackers=blind)] if blind else said


def _best(results: Results, ranked: Sequence[Cell]) -> str:
    best, study = ranked[0], results.study
    size = " ".join(filter(None, (f"{best.mean.value:.2f} m", bounds(best.mean, 2))))
    key = "best" if len(ranked) > 1 else "only" if len(results.runs) > 1 else "only run"
    return say(key, best=best.tracker, size=size, scenarios=len(study.scenarios), seeds=len(study.seeds))


def _lead(results: Results, ranked: Sequence[Cell]) -> str:
    study, best, second = results.study, ranked[0].tracker, ranked[1].tracker
    found = samples(results.runs, "gospa", study.scenarios, study.seeds)
    d = compare(found[second], found[best])  # as the ranking has it: an interval is not that of the opposite, turned
    share, needed = 100 * (1 - d.improvement.value), d.needed if np.isfinite(d.needed) else None
    values = {"lead": d.mean.value, "low": d.mean.low, "high": d.mean.high, "share": share, "needed": needed}
    return say("lead", second=second, verdict=d.verdict, **values)


def _wins(results: Results, best: str) -> str:
    means = results.runs.pivot_table(index="scenario", columns="tracker", values="gospa")
    wins = int((means.idxmin(axis=1) == best).sum())
    return say("wins", wins=wins, scenarios=len(means)) if len(means) > 1 else ""


def _against(cells: Sequence[Cell], results: Results) -> str:
    groups: dict[str, list[str]] = {}
    for c in cells:
        if c.measure == "gospa" and c.difference is not None:
            groups.setdefault(c.difference.verdict, []).append(c.tracker)
    parts = [f"{AGAINST[v]}: {', '.join(groups[v])}" for v in AGAINST if v in groups]
    return say("against", reference=results.study.baseline, parts=parts) if parts else ""


def _besides(cells: Sequence[Cell]) -> str:
    parts = []
    for key in BESIDES:
        known = [c for c in cells if c.measure == key and np.isfinite(c.mean.value)]
        if len(known) > 1 and not key.startswith("nees"):
            metric = METRICS[key]
            best = min(known, key=lambda c, metric=metric: metric.badness(c.mean.value))  # type: ignore[misc]
            unit = f" {metric.unit}" if metric.unit != "1" else ""
            parts.append(f"{metric.label} {best.tracker} ({number(best.mean.value, metric.digits)}{unit})")
    return say("besides", parts=parts) if parts else ""


def _certainty(cells: Sequence[Cell]) -> str:
    known = [c for c in cells if c.measure == "nees_position" and np.isfinite(c.mean.value)]
    if not known:
        return ""
    best = min(known, key=lambda c: METRICS["nees_position"].badness(c.mean.value))
    sure = sum(bool(c.mean.low > 2) for c in known)
    key = "NEES" if len(known) > 1 else "NEES of one"
    return say(key, best=best.tracker, mean=f"{best.mean.value:.1f}", sure=sure, trackers=len(known))


def _cost(results: Results, best: str) -> str:
    """Means of a scan's cost, over scenarios as everything else."""
    if "ms_per_scan" not in results.runs:
        return ""
    means = results.runs.groupby(["tracker", "scenario"])["ms_per_scan"].mean().groupby("tracker").mean()
    known = means.dropna().to_dict()
    if best not in known:
        return ""
    fastest = min(known, key=lambda tracker: known[tracker])
    own, least = f"{known[best]:.1f}", f"{known[fastest]:.1f}"
    return say("cost", best=best, own=own, fastest=fastest, least=least, trackers=len(known))


def regret(
    total: Sequence[PairCell],
    orders: Sequence[PairCell],
    sensing: Sequence[PairCell],
    shares: Sequence[Attribution],
    ranks: Sequence[Correlation],
    pairs: pd.DataFrame,
) -> list[str]:
    """Sentences: where tracks cost score, which tracker is better where, collisions, sensing, groups, the error.

    `total`, `orders` and `sensing` are cells of the score by scenario: against the truth, against the first tracker,
    of what is in view; pairs are those against the truth.
    """
    said = [say("costs", **_where(cells)) for cells in _by_planner(total)]
    said += [say("order", base=orders[0].condition.partition(MINUS)[2], **_where(c)) for c in _by_planner(orders)]
    if len(pairs):
        said.append(say("crashes", crashed=int((pairs["collisions"] > 0).sum()), pairs=len(pairs)))
    said += [say("sensing", **_where(cells)) for cells in _by_planner(sensing)]
    if shares:
        costs = {g: float(np.mean([-a.share[g].value for a in shares])) for g in GROUPS}
        parts = [f"{GROUP_NAMES[g]} {costs[g]:+.3f}" for g in sorted(costs, key=lambda g: -costs[g])]
        said.append(say("groups", parts=parts))
    if ranks:
        said.append(say("error that ranks", label=METRICS[ranks[0].error].label, rho=f"{ranks[0].rho:+.2f}"))
    return said


def _by_planner(cells: Sequence[PairCell]) -> list[list[PairCell]]:
    """The cells of each planner and condition."""
    groups: dict[tuple[str, str], list[PairCell]] = {}
    for cell in cells:
        groups.setdefault((cell.planner, cell.condition), []).append(cell)
    return list(groups.values())


def _where(cells: Sequence[PairCell]) -> dict[str, object]:
    """Planner and condition of cells by scenario, and the scenarios by verdict."""
    found: dict[str, list[str]] = {"worse": [], "better": [], "open": []}
    for cell in cells:
        v = cell.change.mean
        small = max(abs(v.low), abs(v.high)) < SMALL  # False without an interval
        if cell.verdict != "the same" and not small:
            found[cell.verdict if cell.verdict in found else "open"].append(cell.scenario.removeprefix("probe-"))
    tracker = cells[0].condition.partition(MINUS)[0]
    return {"planner": cells[0].planner, "tracker": tracker, **found}
