"""What xu2023 claims, and what our figures say to it; card dra_imm, section 15."""

from collections.abc import Mapping

from testbed.papers.verdict import Claim, Verdict, judge
from testbed.papers.xu2023_reference import TABLE_2

Results = Mapping[tuple[str, str], Mapping[str, float]]
READINGS = (("near", "S"), ("near", "V"), ("far", "V"))  # course of the radar, reading of eq. (42)
MANEUVERS = ("CA", "CT")
UNITS = ("m", "m/s")
WITHIN = 0.2  # relative difference that counts as the same figure
RIGHT = 0.8  # share of scans with the true mode most likely


def verdicts(results: Results) -> tuple[Verdict, ...]:
    """Our answer to every claim."""
    gain = _gain(results, "DRA(CV)", "DRA-IMM", "Interacting models reduce the errors of DRA(CV) in maneuvers")
    further = _gain(results, "DRA-IMM", "EDRA-IMM", "The prior from rays reduces them further")
    return gain, further, table(results), modes(results), both(results), ours(results)


def reduction(results: Results, case: str, before: str, after: str, column: str) -> float:
    """By how many percent the error of `after` is smaller than that of `before`."""
    return 100 * (1 - results[case, after][column] / results[case, before][column])


def _gain(results: Results, before: str, after: str, text: str) -> Verdict:
    held, numbers = {}, []
    for case, reading in READINGS:
        for stage in MANEUVERS:
            r = [reduction(results, case, f"{before}, {reading}", f"{after}, {reading}", f"{stage} {u}") for u in UNITS]
            held[f"{case}, {reading}, {stage}"] = min(r) > 0
            numbers.append(f"{case}, {reading}, {stage} {r[0]:.0f} / {r[1]:.0f}")
    paper = ", ".join(
        f"{stage} {100 * (1 - TABLE_2[after][i] / TABLE_2[before][i]):.0f} / "
        f"{100 * (1 - TABLE_2[after][i + 1] / TABLE_2[before][i + 1]):.0f}"
        for stage, i in (("CA", 2), ("CT", 4))
    )
    return judge(Claim(text, "Table II"), held, f"less by %, position / velocity: {'; '.join(numbers)} (paper {paper})")


def table(results: Results) -> Verdict:
    """How many of the 18 figures come out."""
    held, numbers = {}, []
    for case, reading in READINGS:
        pairs = [
            (results[case, f"{method}, {reading}"][f"{stage} {unit}"], TABLE_2[method][2 * i + j])
            for method in TABLE_2
            for i, stage in enumerate(("CV", "CA", "CT"))
            for j, unit in enumerate(UNITS)
        ]
        same = sum(abs(a / b - 1) < WITHIN for a, b in pairs)
        held[f"{case}, {reading}"] = same == len(pairs)
        numbers.append(f"{case}, {reading}: {same} of {len(pairs)}")
    return judge(Claim("The errors are those of Table II", "Table II"), held, f"within 20 %: {'; '.join(numbers)}")


def modes(results: Results) -> Verdict:
    """Fig. 5."""
    share = {f"{c}, {r}": results[c, f"DRA-IMM, {r}"]["mode"] for c, r in READINGS}
    held = {name: value > RIGHT for name, value in share.items()}
    numbers = ", ".join(f"{name} {value:.2f}" for name, value in share.items())
    return judge(Claim("The true mode is the most likely one", "Fig. 5"), held, f"share of scans: {numbers}")


def both(results: Results) -> Verdict:
    """Whether one reading of eq. (42) gives the table's velocity errors of the turn and the modes of Fig. 5."""
    held, numbers = {}, []
    for case, reading in READINGS:
        row = results[case, f"DRA-IMM, {reading}"]
        held[f"{case}, {reading}"] = abs(row["CT m/s"] / TABLE_2["DRA-IMM"][5] - 1) < WITHIN and row["mode"] > RIGHT
        numbers.append(f"{case}, {reading}: CT {row['CT m/s']:.2f} m/s, mode {row['mode']:.2f}")
    claim = Claim("Table II and Fig. 5 come from the same parameters", "our question, not the paper's")
    return judge(claim, held, f"DRA-IMM, Table II {TABLE_2['DRA-IMM'][5]} m/s: {'; '.join(numbers)}")


def ours(results: Results) -> Verdict:
    """The card's improvements."""
    pairs = {c: (results[c, "EDRA-IMM, V"]["CT m"], results[c, "literal"]["CT m"]) for c in ("near", "far")}
    name = "near, extent follows"
    pairs[name] = results[name, "EDRA-IMM, V"]["CT m"], results[name, "recommended"]["CT m"]
    numbers = ", ".join(f"{case} {a:.2f} / {b:.2f}" for case, (a, b) in pairs.items())
    claim = Claim("Yaw-rate noise, the turn's Jacobian and rectangles cut the error of the turn to a fifth", "our card")
    return judge(claim, {c: b < a / 5 for c, (a, b) in pairs.items()}, f"position RMSE [m] without / with: {numbers}")
