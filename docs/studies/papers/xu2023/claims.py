"""What xu2023 claims, and our answers; docs/reproductions.md has the figures."""

from collections.abc import Mapping

from studies.papers.answer import Answer, Claim, every, judge
from studies.papers.xu2023.cases import VARIED
from studies.papers.xu2023.measures import COLUMNS, READINGS, TABLE_2, UNITS, reductions
from studies.papers.xu2023.simulation import RunErrors
from studies.plus_minus import PlusMinus

Rows = Mapping[tuple[str, str], Mapping[str, float]]  # case and method -> measure -> figure
Runs = Mapping[tuple[str, str], RunErrors]  # case and method
MANEUVERS = ("CA", "CT")
STEPS_UP = (("DRA(CV)", "DRA-IMM"), ("DRA-IMM", "EDRA-IMM"))
WITHIN = 0.2  # relative difference that counts as the same figure
POINTS = 5.0  # [%] difference that counts as the same reduction
RIGHT = 0.8  # share of scans with the true mode most likely


def answers(rows: Rows, runs: Runs) -> tuple[Answer, ...]:
    """An answer to every claim."""
    gain = _gain(runs, *STEPS_UP[0], "Interacting models reduce the errors of DRA(CV) in maneuvers")
    further = _gain(runs, *STEPS_UP[1], "The prior from rays reduces them further")
    unprinted = varied(rows, runs)
    return gain, further, sizes(runs), table(rows), modes(rows), both(rows), *unprinted, ours(rows)


def printed_reduction(before: str, after: str, column: str) -> float:
    """By how many percent Table II has the error of `after` smaller than that of `before`."""
    k = COLUMNS.index(column)
    return 100 * (1 - TABLE_2[after][k] / TABLE_2[before][k])


def _reductions(runs: Runs, case: str, reading: str, before: str, after: str) -> dict[str, PlusMinus]:
    found = reductions(runs[case, f"{before}, {reading}"], runs[case, f"{after}, {reading}"])
    return {column: value for column, value in found.items() if column[:2] in MANEUVERS}


def _pair(found: Mapping[str, PlusMinus], stage: str) -> str:
    return " / ".join(f"{round(found[f'{stage} {u}'].value)} ± {found[f'{stage} {u}'].half:.0f}" for u in UNITS)


def _gain(runs: Runs, before: str, after: str, text: str) -> Answer:
    held, numbers = {}, []
    for case, reading in READINGS:
        found = _reductions(runs, case, reading, before, after)
        for stage in MANEUVERS:
            held[f"{case}, {reading}, {stage}"] = every([found[f"{stage} {u}"].positive for u in UNITS])
        numbers.append(f"{case}, {reading}: " + ", ".join(f"{stage} {_pair(found, stage)}" for stage in MANEUVERS))
    paper = ", ".join(
        f"{stage} " + " / ".join(f"{printed_reduction(before, after, f'{stage} {u}'):.0f}" for u in UNITS)
        for stage in MANEUVERS
    )
    text_of = f"less by %, position / velocity: {'; '.join(numbers)} (paper {paper})"
    return judge(Claim(text, "Table II"), held, text_of)


def sizes(runs: Runs) -> Answer:
    """Whether the reductions are as large as the paper's."""
    held: dict[str, bool | None] = {}
    numbers = []
    for case, reading in READINGS:
        same: list[bool | None] = []
        for before, after in STEPS_UP:
            for column, (value, half) in _reductions(runs, case, reading, before, after).items():
                off = abs(value - printed_reduction(before, after, column))
                same.append(PlusMinus(POINTS - off, half).positive)
        held[f"{case}, {reading}"] = every(same)
        numbers.append(f"{case}, {reading}: {same.count(True)} of {len(same)}, not decided {same.count(None)}")
    claim = Claim("The reductions are as large as the paper's", "Table II")
    return judge(claim, held, f"within {POINTS:.0f} points of its percentages: {'; '.join(numbers)}")


def table(rows: Rows) -> Answer:
    """How many of the 18 figures of Table II are ours within 20 %."""
    held: dict[str, bool | None] = {}
    numbers = []
    for case, reading in READINGS:
        same: list[bool | None] = []
        for method, values in TABLE_2.items():
            row = rows[case, f"{method}, {reading}"]
            for column, printed in zip(COLUMNS, values, strict=True):
                within = WITHIN * printed - abs(row[column] - printed)
                same.append(PlusMinus(within, row[f"{column} 95 %"]).positive)
        held[f"{case}, {reading}"] = every(same)
        numbers.append(f"{case}, {reading}: {same.count(True)} of {len(same)}, not decided {same.count(None)}")
    return judge(Claim("The errors are those of Table II", "Table II"), held, f"within 20 %: {'; '.join(numbers)}")


def modes(rows: Rows) -> Answer:
    """Share of scans in which the true mode is the most likely one."""
    held: dict[str, bool | None] = {}
    numbers = []
    for case, reading in READINGS:
        row = rows[case, f"DRA-IMM, {reading}"]
        share = [row[f"{stage} mode"] for stage in ("CV", "CA", "CT")]
        held[f"{case}, {reading}"] = min(share) > RIGHT
        numbers.append(f"{case}, {reading} " + " / ".join(f"{s:.2f}" for s in share))
    claim = Claim("The true mode is the most likely one", "Fig. 5")
    return judge(claim, held, f"share of scans, CV / CA / CT, bar {RIGHT}: {'; '.join(numbers)}")


def both(rows: Rows) -> Answer:
    """Whether one reading of eq. (42) gives the table's velocity errors of the turn and the modes of Fig. 5."""
    held: dict[str, bool | None] = {}
    numbers = []
    for case, reading in READINGS:
        row = rows[case, f"DRA-IMM, {reading}"]
        near_table = abs(row["CT m/s"] / TABLE_2["DRA-IMM"][5] - 1) < WITHIN
        held[f"{case}, {reading}"] = near_table and row["CT mode"] > RIGHT
        numbers.append(
            f"{case}, {reading}: {row['CT m/s']:.2f} ± {row['CT m/s 95 %']:.2f} m/s, mode {row['CT mode']:.2f}"
        )
    claim = Claim("Table II and Fig. 5 come from the same parameters", "our question, not the paper's")
    return judge(claim, held, f"DRA-IMM while turning, Table II {TABLE_2['DRA-IMM'][5]} m/s: {'; '.join(numbers)}")


def group(variant: str) -> str:
    """What a variant varies."""
    if variant.endswith("deg, 30 m") or variant.startswith("50 deg"):
        return "radar's course"
    return "transition matrix" if variant.startswith("stay") else "first estimate"


def varied(rows: Rows, runs: Runs) -> tuple[Answer, Answer]:
    """How far the result depends on what the paper does not print: the sign of the gain, and the figures."""
    single, several = (f"{VARIED}{name}, S" for name in ("DRA(CV)", "DRA-IMM"))
    variants = [name for case, name in rows if case == several]
    base = variants[0]
    gains = {
        v: reductions(runs.get((single, v), runs[single, base]), runs[several, v]) for v in variants
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
            case: max(_spread(rows, case, [base, *chosen], f"{stage} m") for stage in MANEUVERS)
            for case in (single, several, f"{VARIED}recommended")
        }
        same[what] = max(spread[single], spread[several]) < 1 + WITHIN
        factors.append(f"{what} " + " / ".join(f"{s:.1f}" for s in spread.values()))
    gain = Claim("Interacting models help whatever the paper does not print", "our question")
    figures = Claim("The errors do not depend on what the paper does not print", "our question")
    return (
        judge(gain, sign, f"less by % than DRA(CV) in CA and CT, S: {', '.join(ranges)}"),
        judge(figures, same, f"largest over smallest position error in CA or CT, DRA(CV) / DRA-IMM / recommended: "
               f"{', '.join(factors)}"),
    )  # fmt: skip


def _spread(rows: Rows, case: str, variants: list[str], column: str) -> float:
    values = [rows[case, v][column] for v in variants if (case, v) in rows]
    return max(values) / min(values)


def ours(rows: Rows) -> Answer:
    """Error of the turn with our changes against that without them."""
    pairs = {c: (rows[c, "EDRA-IMM, V"]["CT m"], rows[c, "literal"]["CT m"]) for c in ("near", "far")}
    name = "near, extent follows"
    pairs[name] = rows[name, "EDRA-IMM, V"]["CT m"], rows[name, "recommended"]["CT m"]
    numbers = ", ".join(f"{case} {a:.2f} / {b:.2f}" for case, (a, b) in pairs.items())
    claim = Claim("Yaw-rate noise, the turn's Jacobian and rectangles cut the error of the turn to a fifth", "ours")
    return judge(claim, {c: b < a / 5 for c, (a, b) in pairs.items()}, f"position RMSE [m] without / with: {numbers}")
