"""What xu2023 claims, and what our figures say to it; card dra_imm, section 15.

A condition holds, fails, or is not decided: a 95 % interval holds the bar.
"""

from collections.abc import Mapping

from testbed.evaluation.intervals import PlusMinus
from testbed.papers.verdict import CONFIRMED, REFUTED, Claim, Verdict
from testbed.papers.xu2023.cases import VARIED
from testbed.papers.xu2023.measures import UNITS, reductions
from testbed.papers.xu2023.reference import COLUMNS, READINGS, TABLE_2
from testbed.papers.xu2023.trials import Trace

Results = Mapping[tuple[str, str], Mapping[str, float]]
Traces = Mapping[tuple[str, str], Trace]
MANEUVERS = ("CA", "CT")
STEPS_UP = (("DRA(CV)", "DRA-IMM"), ("DRA-IMM", "EDRA-IMM"))
WITHIN = 0.2  # relative difference that counts as the same figure
POINTS = 5.0  # [%] difference that counts as the same reduction
RIGHT = 0.8  # share of scans with the true mode most likely
OPEN = "not decided"


def verdicts(results: Results, traces: Traces) -> tuple[Verdict, ...]:
    """Our answer to every claim."""
    gain = _gain(traces, *STEPS_UP[0], "Interacting models reduce the errors of DRA(CV) in maneuvers")
    further = _gain(traces, *STEPS_UP[1], "The prior from rays reduces them further")
    unprinted = varied(results, traces)
    return gain, further, sizes(traces), table(results), modes(results), both(results), *unprinted, ours(results)


def decide(claim: Claim, cases: Mapping[str, bool | None], numbers: str) -> Verdict:
    """Verdict from the conditions that were tried, None where the interval holds the bar.

    >>> decide(Claim("better", "IV"), {"near": True, "far": None}, "").outcome
    'confirmed under near; not decided under far'
    """
    held = [name for name, holds in cases.items() if holds]
    unclear = [name for name, holds in cases.items() if holds is None]
    if len(held) == len(cases):
        return Verdict(claim, CONFIRMED, numbers)
    if len(unclear) == len(cases):
        return Verdict(claim, OPEN, numbers)
    parts = [f"confirmed under {'; '.join(held)}"] if held else []
    parts += [f"{OPEN} under {'; '.join(unclear)}"] if unclear else []
    return Verdict(claim, "; ".join(parts) or REFUTED, numbers)


def every(values: list[bool | None]) -> bool | None:
    """Whether all hold: false if one fails, None if one of the others is not decided."""
    return False if False in values else None if None in values else True


def printed_reduction(before: str, after: str, column: str) -> float:
    """By how many percent Table II has the error of `after` smaller than that of `before`."""
    k = COLUMNS.index(column)
    return 100 * (1 - TABLE_2[after][k] / TABLE_2[before][k])


def _reductions(traces: Traces, case: str, reading: str, before: str, after: str) -> dict[str, PlusMinus]:
    found = reductions(traces[case, f"{before}, {reading}"], traces[case, f"{after}, {reading}"])
    return {column: value for column, value in found.items() if column[:2] in MANEUVERS}


def _pair(found: Mapping[str, PlusMinus], stage: str) -> str:
    return " / ".join(f"{round(found[f'{stage} {u}'].value)} ± {found[f'{stage} {u}'].half:.0f}" for u in UNITS)


def _gain(traces: Traces, before: str, after: str, text: str) -> Verdict:
    held, numbers = {}, []
    for case, reading in READINGS:
        found = _reductions(traces, case, reading, before, after)
        for stage in MANEUVERS:
            held[f"{case}, {reading}, {stage}"] = every([found[f"{stage} {u}"].positive for u in UNITS])
        numbers.append(f"{case}, {reading}: " + ", ".join(f"{stage} {_pair(found, stage)}" for stage in MANEUVERS))
    paper = ", ".join(
        f"{stage} " + " / ".join(f"{printed_reduction(before, after, f'{stage} {u}'):.0f}" for u in UNITS)
        for stage in MANEUVERS
    )
    text_of = f"less by %, position / velocity: {'; '.join(numbers)} (paper {paper})"
    return decide(Claim(text, "Table II"), held, text_of)


def sizes(traces: Traces) -> Verdict:
    """Whether the reductions are as large as the paper's."""
    held: dict[str, bool | None] = {}
    numbers = []
    for case, reading in READINGS:
        same: list[bool | None] = []
        for before, after in STEPS_UP:
            for column, (value, half) in _reductions(traces, case, reading, before, after).items():
                off = abs(value - printed_reduction(before, after, column))
                same.append(None if abs(off - POINTS) < half else off < POINTS)
        held[f"{case}, {reading}"] = every(same)
        numbers.append(f"{case}, {reading}: {same.count(True)} of {len(same)}, not decided {same.count(None)}")
    claim = Claim("The reductions are as large as the paper's", "Table II")
    return decide(claim, held, f"within {POINTS:.0f} points of its percentages: {'; '.join(numbers)}")


def table(results: Results) -> Verdict:
    """How many of the 18 figures come out."""
    held: dict[str, bool | None] = {}
    numbers = []
    for case, reading in READINGS:
        same: list[bool | None] = []
        for method, values in TABLE_2.items():
            row = results[case, f"{method}, {reading}"]
            for column, printed in zip(COLUMNS, values, strict=True):
                off = abs(row[column] - printed) - WITHIN * printed
                same.append(None if abs(off) < row[f"{column} 95 %"] else off < 0)
        held[f"{case}, {reading}"] = every(same)
        numbers.append(f"{case}, {reading}: {same.count(True)} of {len(same)}, not decided {same.count(None)}")
    return decide(Claim("The errors are those of Table II", "Table II"), held, f"within 20 %: {'; '.join(numbers)}")


def modes(results: Results) -> Verdict:
    """Fig. 5."""
    held: dict[str, bool | None] = {}
    numbers = []
    for case, reading in READINGS:
        row = results[case, f"DRA-IMM, {reading}"]
        share = [row[f"{stage} mode"] for stage in ("CV", "CA", "CT")]
        held[f"{case}, {reading}"] = min(share) > RIGHT
        numbers.append(f"{case}, {reading} " + " / ".join(f"{s:.2f}" for s in share))
    claim = Claim("The true mode is the most likely one", "Fig. 5")
    return decide(claim, held, f"share of scans, CV / CA / CT, bar {RIGHT}: {'; '.join(numbers)}")


def both(results: Results) -> Verdict:
    """Whether one reading of eq. (42) gives the table's velocity errors of the turn and the modes of Fig. 5."""
    held: dict[str, bool | None] = {}
    numbers = []
    for case, reading in READINGS:
        row = results[case, f"DRA-IMM, {reading}"]
        near_table = abs(row["CT m/s"] / TABLE_2["DRA-IMM"][5] - 1) < WITHIN
        held[f"{case}, {reading}"] = near_table and row["CT mode"] > RIGHT
        numbers.append(
            f"{case}, {reading}: {row['CT m/s']:.2f} ± {row['CT m/s 95 %']:.2f} m/s, mode {row['CT mode']:.2f}"
        )
    claim = Claim("Table II and Fig. 5 come from the same parameters", "our question, not the paper's")
    return decide(claim, held, f"DRA-IMM while turning, Table II {TABLE_2['DRA-IMM'][5]} m/s: {'; '.join(numbers)}")


def group(variant: str) -> str:
    """What a variant varies."""
    if variant.endswith("deg, 30 m") or variant.startswith("50 deg"):
        return "radar's course"
    return "transition matrix" if variant.startswith("stay") else "first estimate"


def varied(results: Results, traces: Traces) -> tuple[Verdict, Verdict]:
    """How far the result depends on what the paper does not print: the sign of the gain, and the figures."""
    single, several = (f"{VARIED}{name}, S" for name in ("DRA(CV)", "DRA-IMM"))
    variants = [name for case, name in results if case == several]
    base = variants[0]
    gains = {
        v: reductions(traces.get((single, v), traces[single, base]), traces[several, v]) for v in variants
    }  # DRA(CV) has no transition matrix
    sign: dict[str, bool | None] = {}
    same: dict[str, bool | None] = {}
    ranges, factors = [], []
    for what in dict.fromkeys(map(group, variants)):
        chosen = [v for v in variants if group(v) == what]
        found = [gains[v][f"{stage} {u}"] for v in chosen for stage in MANEUVERS for u in UNITS]
        sign[what] = every([g.positive for g in found])
        ranges.append(f"{what} {min(g.value for g in found):.0f} to {max(g.value for g in found):.0f}")
        spread = {
            case: max(_spread(results, case, [base, *chosen], f"{stage} m") for stage in MANEUVERS)
            for case in (single, several, f"{VARIED}recommended")
        }
        same[what] = max(spread[single], spread[several]) < 1 + WITHIN
        factors.append(f"{what} " + " / ".join(f"{s:.1f}" for s in spread.values()))
    gain = Claim("Interacting models help whatever the paper does not print", "our question")
    figures = Claim("The errors do not depend on what the paper does not print", "our question")
    return (
        decide(gain, sign, f"less by % than DRA(CV) in CA and CT, S: {', '.join(ranges)}"),
        decide(figures, same, f"largest over smallest position error in CA or CT, DRA(CV) / DRA-IMM / recommended: "
               f"{', '.join(factors)}"),
    )  # fmt: skip


def _spread(results: Results, case: str, variants: list[str], column: str) -> float:
    values = [results[case, v][column] for v in variants if (case, v) in results]
    return max(values) / min(values)


def ours(results: Results) -> Verdict:
    """The card's improvements."""
    pairs = {c: (results[c, "EDRA-IMM, V"]["CT m"], results[c, "literal"]["CT m"]) for c in ("near", "far")}
    name = "near, extent follows"
    pairs[name] = results[name, "EDRA-IMM, V"]["CT m"], results[name, "recommended"]["CT m"]
    numbers = ", ".join(f"{case} {a:.2f} / {b:.2f}" for case, (a, b) in pairs.items())
    claim = Claim("Yaw-rate noise, the turn's Jacobian and rectangles cut the error of the turn to a fifth", "our card")
    return decide(claim, {c: b < a / 5 for c, (a, b) in pairs.items()}, f"position RMSE [m] without / with: {numbers}")
