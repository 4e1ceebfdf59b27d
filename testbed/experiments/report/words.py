"""What the statistics of a comparison say, in sentences."""

from collections.abc import Sequence

import numpy as np

from testbed.command_line.tables import number
from testbed.evaluation.intervals import FEWEST
from testbed.evaluation.metric import METRICS
from testbed.experiments.report.grouping import listed, reach
from testbed.experiments.report.ranking import order as by_gospa
from testbed.experiments.report.tables import bounds
from testbed.experiments.statistics import MAIN, Cell, compare, samples
from testbed.experiments.store import Results

BESIDES = tuple(key for key in MAIN if key != "gospa")


def verdict(results: Results, cells: Sequence[Cell]) -> list[str]:
    """Best in GOSPA and whether that is resolved, the others against the reference, then the other measures."""
    order = by_gospa(cells)
    if not order:
        return ["No run has a GOSPA yet, so there is nothing to compare."]
    sentences = [_best(results, order)]
    if len(order) > 1:
        sentences += [_lead(results, order), _wins(results, order[0].tracker), _against(cells, results)]
    sentences += [_besides(cells), _certainty(cells), _cost(results, order[0].tracker)]
    return [s for s in sentences if s]


def caveats(results: Results, cells: Sequence[Cell]) -> list[str]:
    """What a reader should know before using the tables."""
    comparison = results.study
    found = []
    if len(comparison.seeds) < FEWEST:
        few = f"{_count(len(comparison.seeds), 'seed')} {'is' if len(comparison.seeds) == 1 else 'are'}"
        found.append(f"{few} too few for intervals: {FEWEST} are the least.")
    found += [*_lacking(results), *_blind(results, cells), *_unreached(results)]
    count = sum(c.difference is not None and np.isfinite(c.difference.mean.low) for c in cells)
    if count >= 20:
        found.append(
            f"Every interval holds alone with 95 %: of {count} differences about {count / 20:.0f} would seem resolved "
            "by chance if there were none."
        )
    return found


def _missing(results: Results) -> dict[str, int]:
    """Number of missing runs of each tracker."""
    return {t: sum(run.source == t for run in results.missing) for t in results.study.trackers}


def _each(results: Results) -> int:
    """Number of runs that each tracker should have."""
    return len(results.study.scenarios) * len(results.study.seeds)


def _lacking(results: Results) -> list[str]:
    """A sentence for all trackers that lack the same number of runs."""
    alike: dict[int, list[str]] = {}
    for tracker, count in _missing(results).items():
        alike.setdefault(count, []).append(tracker)
    alike.pop(0, None)
    each, said = _each(results), []
    for count, names in alike.items():
        one = len(names) == 1
        if count == each:
            has = "has no finished run and is" if one else "have no finished run and are"
            said.append(f"{listed(names)} {has} left out.")
        else:
            lack, their = ("lacks", "its") if one else ("lack", "their")
            apiece = "" if one else " each"
            said.append(
                f"{listed(names)} {lack} {count} of {each} runs{apiece}: {their} means are over the others, see below."
            )
    return said


def _blind(results: Results, cells: Sequence[Cell]) -> list[str]:
    """A sentence for all trackers that have runs, but no track on any object."""
    missing, each = _missing(results), _each(results)
    seeing = {c.tracker for c in cells if c.measure == "rmse_position" and np.isfinite(c.mean.value)}
    names = [t for t in results.study.trackers if missing[t] < each and t not in seeing]
    if not names:
        return []
    it = "it has" if len(names) == 1 else "they have"
    return [f"{listed(names)} never tracked an object, so {it} no errors of position, velocity and extent."]


def _unreached(results: Results) -> list[str]:
    """A sentence for the phases of the maneuver in which no run has a scan."""
    empty = [phase.text for phase in reach(results) if not phase.reached]
    phases = "this phase" if len(empty) == 1 else "these phases"
    return [f"{listed(empty)}: no mean is of {phases} of the maneuver."] if empty else []


def _best(results: Results, order: Sequence[Cell]) -> str:
    best = order[0]
    comparison = results.study
    where = f"{_count(len(comparison.scenarios), 'scenario')} and {_count(len(comparison.seeds), 'seed')}"
    size = " ".join(filter(None, (f"{best.mean.value:.2f} m", bounds(best.mean, 2))))
    if len(order) == 1:
        return f"{best.tracker} has a mean GOSPA of {size} over {where}; there is no other tracker to compare it with."
    return f"{best.tracker} is best in GOSPA: {size} over {where}."


def _lead(results: Results, order: Sequence[Cell]) -> str:
    comparison = results.study
    best, second = order[0].tracker, order[1].tracker
    found = samples(results.runs, "gospa", comparison.scenarios, comparison.seeds)
    d = compare(found[second], found[best])  # as the ranking has it: an interval is not that of the opposite, turned
    lead = f"{d.mean.value:.2f} m"
    if d.verdict == "worse":
        return (
            f"Its lead over the next, {second}, is {lead} [{d.mean.low:.2f}, {d.mean.high:.2f}] and resolved; "
            f"it is the better one in {100 * (1 - d.improvement.value):.0f} % of the runs."
        )
    if d.verdict == "too few seeds":
        return f"The next is {second}, {lead} behind; the seeds are too few to say whether that is chance."
    if not np.isfinite(d.needed):
        return f"The next, {second}, is as good."
    return (
        f"Its lead over the next, {second}, is {lead} and not resolved: about {d.needed:.0f} seeds a scenario would "
        "resolve it, if the difference stays what it is."
    )


def _wins(results: Results, best: str) -> str:
    means = results.runs.pivot_table(index="scenario", columns="tracker", values="gospa")
    wins = int((means.idxmin(axis=1) == best).sum())
    return f"It has the smallest mean GOSPA in {wins} of {_count(len(means), 'scenario')}." if len(means) > 1 else ""


def _against(cells: Sequence[Cell], results: Results) -> str:
    groups: dict[str, list[str]] = {}
    for c in cells:
        if c.measure == "gospa" and c.difference is not None:
            groups.setdefault(c.difference.verdict, []).append(c.tracker)
    words = {"better": "better", "worse": "worse", "unresolved": "not resolved", "the same": "the same",
             "too few seeds": "too few seeds to judge"}  # fmt: skip
    parts = [f"{words[v]}: {', '.join(groups[v])}" for v in words if v in groups]
    return f"GOSPA against the reference {results.study.baseline} – {'; '.join(parts)}." if parts else ""


def _besides(cells: Sequence[Cell]) -> str:
    parts = []
    for key in BESIDES:
        known = [c for c in cells if c.measure == key and np.isfinite(c.mean.value)]
        if len(known) > 1 and not key.startswith("nees"):
            best = min(known, key=lambda c: METRICS[key].badness(c.mean.value))
            unit = f" {METRICS[key].unit}" if METRICS[key].unit != "1" else ""
            parts.append(f"{METRICS[key].label} {best.tracker} ({number(best.mean.value, METRICS[key].digits)}{unit})")
    return f"Smallest means besides: {', '.join(parts)}." if parts else ""


def _certainty(cells: Sequence[Cell]) -> str:
    known = [c for c in cells if c.measure == "nees_position" and np.isfinite(c.mean.value)]
    if not known:
        return ""
    best = min(known, key=lambda c: METRICS["nees_position"].badness(c.mean.value))
    sure = sum(bool(c.mean.low > 2) for c in known)
    say = f"The NEES of the position is nearest to its ideal 2 for {best.tracker} ({best.mean.value:.1f})"
    if not sure:
        return f"{say}."
    return f"{say}; {sure} of {_count(len(known), 'tracker')} are overconfident (interval above 2)."


def _cost(results: Results, best: str) -> str:
    """Means of a scan's cost, over scenarios as everything else."""
    if "ms_per_scan" not in results.runs:
        return ""
    means = results.runs.groupby(["tracker", "scenario"])["ms_per_scan"].mean().groupby("tracker").mean()
    known = means.dropna().to_dict()
    if best not in known:
        return ""
    fastest = min(known, key=lambda tracker: known[tracker])
    if fastest == best:
        return f"A scan costs {best} {known[best]:.1f} ms{', the least of all' if len(known) > 1 else ''}."
    return f"A scan costs {best} {known[best]:.1f} ms; the fastest, {fastest}, takes {known[fastest]:.1f} ms."


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
