"""What the two papers of xia2020 claim, and our answers.

"Slides": the hierarchical truncated Gaussian with online bounds. "Paper": the learned one. Where a claim is about "the
method", it is tried on the update that the text gives ("literal"), on its repair by counting true detections only
("n-count"), and on the same density used as a likelihood (htg-map). Gaussian Wasserstein distances are squared, GWD^2.
"""

from collections.abc import Mapping
from time import process_time

import numpy as np

from studies.papers.answer import Answer, Claim, judge
from studies.papers.xia2020.generators import GENERATORS, draw_training
from studies.papers.xia2020.methods import (
    BEST,
    LEARNED,
    LEARNED_LOOSE,
    LEARNED_N,
    MAP,
    MM,
    ON_OTHER,
    ON_REAL,
    ON_RIG,
    ONLINE,
    ONLINE_N,
    PARTIAL_MASS,
    RM,
    RM_MATCHED,
    full_table,
    paper_table,
    partial_table,
)
from studies.papers.xia2020.radar import SCENARIOS
from studies.papers.xia2020.results import TrialRuns
from studies.papers.xia2020.trials import SIZE, NamedFilter, Trial
from trackers.batch import take
from trackers.htg.bins import HTGTable
from trackers.htg.density import log_density

LARGE = 0.5  # "a large margin": at most half the baseline's GWD^2
CYCLE = 50.0  # [ms] of a radar: what "light-weight" must fit into, in numpy on one core
COURSES = ("following, 2 Hz", "right turn, 2 Hz", "S curve, 2 Hz")
FORMS = {"literal": LEARNED, "n-count": LEARNED_N, "HTG-MM": MM, "HTG-MAP": MAP, "calibrated HTG-MAP": BEST}
SPARSE, ROUGH = "following, 2 Hz, 2 detections", "following, 2 Hz, rough start"
HELD_OUT = 10000  # detections


def text(figures: Mapping[str, float], digits: int = 2) -> str:
    """Named figures as text."""
    return ", ".join(f"{name} {value:.{digits}f}" for name, value in figures.items())


# -- the slides -------------------------------------------------------------------------------------------------------


def slides(results: TrialRuns) -> tuple[Answer, ...]:
    """Answers to the slides; the results are those of the full view and of the 2 Hz courses."""
    return (
        against_rm(results, "band", "with the ideal measurement model (uniform band)"),
        against_rm(results, "vrm", "under measurement model mismatch (Student-t mixture)"),
        biased_statistics(results),
        open_sides(results),
        light_weight(results),
    )


def against_rm(results: TrialRuns, generator: str, words: str) -> Answer:
    """The main claim in full view, against either baseline."""
    claim = Claim(f"The method with online bounds is more accurate than the random matrix {words}", "slides, results")
    case = f"full view, {generator}"
    got = {m: results.gwd2(case, m) for m in (ONLINE, RM, RM_MATCHED, MAP)}
    return judge(claim, {f"the baseline {m}": got[ONLINE] < got[m] for m in (RM, RM_MATCHED)}, f"GWD^2 {text(got)}")


def biased_statistics(results: TrialRuns) -> Answer:
    """Mean length error of either random matrix; more than half a metre counts as a bias."""
    claim = Claim("Statistics of edge detections are biased, so the random matrix is off", "slides, problem")
    names = {f"{m}, {g}": (f"full view, {g}", m) for m in (RM, RM_MATCHED) for g in GENERATORS}
    bias = {name: float(results.errors[key].length.mean()) for name, key in names.items()}
    return judge(claim, {n: abs(b) > 0.5 for n, b in bias.items()}, f"mean length error [m]: {text(bias)}")


def open_sides(results: TrialRuns) -> Answer:
    """GWD^2 in partial view, where bounds are open on the sides that the sensor does not see."""
    claim = Claim("Bounds at infinity model self-occlusion: partial views are tracked better", "slides, model")
    return large_margin(results, claim, {"literal": ONLINE, "n-count": ONLINE_N}, 1.0)


def light_weight(results: TrialRuns) -> Answer:
    """CPU time of an update, one object."""
    claim = Claim("A light-weight method, implementable on an automotive control unit", "slides, contributions")
    trial = results.trials["full view, band"]
    ms = {name: cost(method, trial) for name, method in results.methods("full view, band", (RM, ONLINE, MAP)).items()}
    return judge(claim, {f"{CYCLE:g} ms an update": ms[ONLINE] < CYCLE}, f"ms an update, one object: {text(ms)}")


# -- the paper --------------------------------------------------------------------------------------------------------


def paper(results: TrialRuns) -> tuple[Answer, ...]:
    """Answers to the paper; the results are those of all cases."""
    margin = Claim("Learned HTG-RM outperforms the random matrix by a large margin, partial view", "paper, V-B")
    return (
        resemblance(),
        large_margin(results, margin, FORMS, LARGE),
        rig_margin(results),
        sensitive(results),
        seen_part(results),
        cheaper(results),
        sparse(results),
        robust(results),
        rig_mismatch(results),
    )


def gain(table: HTGTable, u: np.ndarray, aspect: np.ndarray) -> float:
    """Mean log-likelihood [nat] a detection of the learned density over a Gaussian in each bin, held-out data."""
    b = table.bin_of(aspect)
    d, C = u - table.mean[b], table.cov[b]
    square = (d * np.linalg.solve(C, d[..., None])[..., 0]).sum(-1)
    gauss = -0.5 * square - 0.5 * np.log(np.linalg.det(C)) - np.log(2 * np.pi)
    return float((log_density(u, table.of(b)) - gauss).mean())


def resemblance() -> Answer:
    """Held-out likelihood of the learned density against the Gaussian that a random matrix assumes."""
    claim = Claim("The learned density resembles where radar detections lie", "paper, abstract")
    got = {}
    for name, draw in GENERATORS.items():
        u = draw(np.random.default_rng(1), (HELD_OUT,), SIZE)
        got[name] = gain(full_table(name), u, np.zeros(HELD_OUT))
    data = draw_training(np.random.default_rng(1), HELD_OUT)
    got["partial view"] = gain(partial_table(), data.u, data.aspect)
    got["partial view, c_D held"] = gain(paper_table(PARTIAL_MASS), data.u, data.aspect)
    held = {name: value > 0 for name, value in got.items()}
    return judge(claim, held, f"held-out log-likelihood over a Gaussian a bin [nat a detection]: {text(got)}")


def large_margin(results: TrialRuns, claim: Claim, forms: Mapping[str, str], margin: float) -> Answer:
    """A form holds where its GWD^2 is below margin times that of both random matrices on every course."""
    best = {c: min(results.gwd2(c, m) for m in (RM, RM_MATCHED)) for c in COURSES}
    got = {form: [results.gwd2(c, m) for c in COURSES] for form, m in forms.items()}
    held = {form: all(g < margin * best[c] for g, c in zip(gs, COURSES)) for form, gs in got.items()}
    numbers = "; ".join(f"{form} {' / '.join(f'{g:.2f}' for g in gs)}" for form, gs in got.items())
    baseline = " / ".join(f"{b:.2f}" for b in best.values())
    return judge(claim, held, f"GWD^2 following / turn / S: better RM {baseline}; {numbers}")


def on_radar(results: TrialRuns) -> tuple[str, ...]:
    """The cases before our radar."""
    return tuple(case for case in results.trials if case.startswith(SCENARIOS))


def rig_margin(results: TrialRuns) -> Answer:
    """`large_margin` on detections of our ray-cast radar."""
    claim = Claim("The same on our ray-cast radar, learned on its own rig", "paper, V-B, our detections")
    forms, cases = {"literal": LEARNED, "n-count": LEARNED_N, "HTG-MM": MM, "HTG-MAP": ON_RIG}, on_radar(results)
    best = {c: min(results.gwd2(c, m) for m in (RM, RM_MATCHED)) for c in cases}
    held = {f: all(results.gwd2(c, m) < LARGE * best[c] for c in cases) for f, m in forms.items()}
    rows = (f"{c}: better RM {best[c]:.2f}, {text({f: results.gwd2(c, m) for f, m in forms.items()})}" for c in cases)
    return judge(claim, held, f"GWD^2 {'; '.join(rows)}")


def sensitive(results: TrialRuns) -> Answer:
    """GWD^2 from a start that is off by 1 m over that from the true start, on the same detections."""
    claim = Claim("The update is sensitive to a prediction that is far off", "paper, V-B")
    forms = {**FORMS, "literal, c_D from .1": LEARNED_LOOSE, "literal, online bounds": ONLINE}
    ratio = {f: results.gwd2(ROUGH, m) / results.gwd2(COURSES[0], m) for f, m in {**forms, "RM": RM}.items()}
    held = {f: ratio[f] > 1.2 for f in forms}
    return judge(claim, held, f"GWD^2 with a start off by 1 m over that with the true start: {text(ratio)}")


def seen_part(results: TrialRuns) -> Answer:
    """How far the centre is shifted to the sensor, following course."""
    claim = Claim("The random matrix fits the part in sight, HTG-RM does not", "paper, V-B")
    case = COURSES[0]
    shift = {m: results.shift_to_sensor(case, m) for m in (RM, RM_MATCHED, *FORMS.values())}
    held = {f: shift[RM] > 0.5 and abs(shift[m]) < shift[RM] / 2 for f, m in FORMS.items()}
    return judge(claim, held, f"mean shift of the centre towards the sensor [m]: {text(shift)}")


def cheaper(results: TrialRuns) -> Answer:
    """CPU time of the learned and the online update, five iterations each."""
    claim = Claim("The learned update is computationally simpler than that with online bounds", "paper, IV-B")
    case = COURSES[0]
    ms = {n: cost(m, results.trials[case]) for n, m in results.methods(case, (RM, ONLINE, LEARNED, MM, MAP)).items()}
    return judge(claim, {"CPU time": ms[LEARNED] < ms[ONLINE]}, f"ms an update, one object: {text(ms)}")


def sparse(results: TrialRuns) -> Answer:
    """GWD^2 with two detections a scan instead of five."""
    claim = Claim("Improved tracking with sparse measurements", "paper, IV-B")
    others = (RM, RM_MATCHED, ONLINE, ONLINE_N)
    got = {m: results.gwd2(SPARSE, m) for m in (*others, *FORMS.values())}
    best = min(got[m] for m in others)
    return judge(claim, {f: got[m] < best for f, m in FORMS.items()}, f"GWD^2 at 2 detections a scan: {text(got)}")


def foreign_name(form: str, generator: str) -> str:
    """Row of a form whose table was learned on another generator."""
    return f"{form} of {generator}"


def robust(results: TrialRuns) -> Answer:
    """GWD^2 with the table of another full-view generator."""
    claim = Claim("A learned structure is robust to a mismatch between training data and detections", "paper, I")
    held, numbers = {}, []
    for form in (LEARNED_N, MAP):
        for g in GENERATORS:
            case = f"full view, {g}"
            got = {t: results.gwd2(case, foreign_name(form, t)) for t in GENERATORS if t != g}
            worst = max(got.values())
            held[f"{form} on {g}"] = worst < results.gwd2(case, RM_MATCHED)
            numbers.append(f"{form} on {g}: own table {results.gwd2(case, form):.2f}, of {text(got)}")
    best = text({g: results.gwd2(f"full view, {g}", RM_MATCHED) for g in GENERATORS})
    return judge(claim, held, f"GWD^2 RM, matched rho {best}; {'; '.join(numbers)}")


def rig_mismatch(results: TrialRuns) -> Answer:
    """A table of another radar, or of real detections, against random matrices, which need no learning."""
    claim = Claim("Learned on one radar and used on another, HTG-MAP still beats the random matrices", "paper, I")
    rows = {case: (ON_RIG, {"imaging": ON_OTHER, "real": ON_REAL}) for case in on_radar(results)}
    rows |= {case: (MAP, {"surround": ON_RIG}) for case in COURSES}
    held: dict[str, bool] = {}
    numbers = []
    for case, (own, others) in rows.items():
        best = min(results.gwd2(case, m) for m in (RM, RM_MATCHED))
        got = {source: results.gwd2(case, m) for source, m in others.items()}
        held |= {f"{case} with the table of {source}": g < best for source, g in got.items()}
        numbers.append(f"{case}: better RM {best:.2f}, own table {results.gwd2(case, own):.2f}, of {text(got)}")
    return judge(claim, held, f"GWD^2 {'; '.join(numbers)}")


def cost(method: NamedFilter, trial: Trial, steps: int = 30) -> float:
    """Median CPU time [ms] of an update of one object."""
    one = np.array([0])
    f, scan = method.make(), take(trial.scan, np.arange(steps))
    state = f.init(take(trial.start, one)._replace(size_std=method.size_std * take(trial.start, one).size))
    spent = []
    for k in range(steps):
        now = take(take(scan, np.array(k)), one)
        state = f.predict(state, trial.dt)
        begin = process_time()
        state, _ = f.update(state, now)
        spent.append(process_time() - begin)
    return 1e3 * float(np.median(spent))
