"""What a one-sided view does to pmht-spline, with and without weights by visibility: the page docs/partial-view.md."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray

import sensors
from scenarios.contours import CONTOURS
from studies.page import DOCS, Docs, Page, fill, steps
from studies.partial_view.encounters import STEP, encounters, follow, measure, simulate
from studies.partial_view.figure import ContourPanel, draw_learned, draw_tracked
from studies.plus_minus import PlusMinus
from testbed.command_line.terminal import user_input
from testbed.evaluation.metric import METRICS
from testbed.evaluation.metrics import contour_iou
from testbed.evaluation.tracking import Evaluator, Row
from testbed.learn.detections import TrainingDetections, read
from testbed.learn.models import fit_spline
from testbed.log.text import markdown_table
from testbed.replay.recording import Recording, record
from trackers import MultiObjectTracker, find
from trackers.pmht import AdaptiveSpline, Learner
from trackers.pmht.classes import Catalogue
from trackers.pmht.model import SplineModel, outlines
from trackers.pmht.offline import LearnedContour, OfflineLearning

RADAR = "surround"
KINDS = ("car", "truck", "tractor")
COURSES = ("yao2021-truck", "yao2021-tractor")
REFERENCE = "htg-map"
ADAPTED = "rays, adapted"
MIXED = ", learned with"  # part of the names of filters that the figure leaves out
SINCE = 40  # frames before errors count
DETECTIONS = 5000  # of the training sampler, to learn a model from
SIDES: dict[str, Callable[[NDArray], NDArray]] = {  # by the aspect angle, 0 at the rear
    "all sides": lambda a: np.isfinite(a),
    "rear and left": lambda a: (a > -0.25) & (a < np.pi / 2),
    "rear only": lambda a: np.abs(a) < 0.25,
}
MEASURES = {
    "along": "bias along [m]",
    "across": "bias across [m]",
    "length": "length bias [m]",
    "length rms": "length error, rms [m]",
    "iou": "contour IoU",
    "nees": "NEES of the centre",
}
DRAWN = {
    "along": "magnitude of the bias along [m]",
    "length rms": "length error, rms [m]",
    "iou": "contour IoU",
    "nees": "NEES of the centre, ideal 2",
}
COLUMNS = (  # of a run with the multi-object tracker
    "gospa", "rmse_position", "rmse_velocity", "rmse_heading_deg", "rmse_length", "rmse_width", "contour_iou",
    "nees_position", "nees_velocity",
)  # fmt: skip
NextStep = Callable[[str], None]  # called with what comes next
Tracked = dict[tuple[str, str, str], dict[str, PlusMinus]]  # class, view, variant


class Sided(NamedTuple):
    """A contour learned from detections of some sides."""

    sides: str
    visibility: str
    model: SplineModel
    learned: LearnedContour
    z: NDArray  # (N, 2) what it was learned from, in the unit frame


def learned_models(visibility: str, next_step: NextStep) -> tuple[SplineModel, ...]:
    """Of cars and trucks, from the training sampler."""
    found = []
    for kind in ("car", "truck"):
        next_step(f"learn {kind}, {visibility}")
        detections = read(f"sampler:{RADAR}:{kind}", DETECTIONS, 1)
        found.append(
            fit_spline(detections, OfflineLearning(visibility=visibility, iterations=40), f"{kind}-{visibility}")[0]
        )
    return tuple(found)


def variants(rays: tuple[SplineModel, ...], none: tuple[SplineModel, ...], at_once: int) -> dict[str, Any]:
    """Filters by name: weights by visibility in the filter, in the learning of its model, in both, in neither.

    Those that adapt their contours do so for at_once vehicles in a scan.
    """
    found: dict[str, Any] = {
        "rays": find("pmht-spline", model=rays, visibility="rays"),
        "rays, learned with none": find("pmht-spline", model=none, visibility="rays"),
        "none, learned with rays": find("pmht-spline", model=rays, visibility="none"),
        "none": find("pmht-spline", model=none, visibility="none"),
    }
    return found | {
        ADAPTED: AdaptiveSpline(Learner(found["rays"]), at_once=at_once),
        "none, adapted": AdaptiveSpline(Learner(found["none"], catalogue=Catalogue(unseen=1.0)), at_once=at_once),
        REFERENCE: find(REFERENCE),
    }


def tracked(filters: Mapping[str, Any], runs: int, seed: int, next_step: NextStep) -> Tracked:
    """Every filter on the same detections of every class in every view."""
    radar = sensors.find(RADAR)
    found: Tracked = {}
    for i, kind in enumerate(KINDS):
        for j, encounter in enumerate(encounters()):
            next_step(f"{kind}, {encounter.view}")
            simulated = simulate(encounter, radar, kind, runs, np.random.default_rng([seed, i, j]))
            for name, filter in filters.items():
                found[kind, encounter.view, name] = measure(follow(filter, simulated), SINCE)
    return found


def from_sides(next_step: NextStep) -> list[Sided]:
    """Contours of cars learned from those detections of the sampler that come from some sides."""
    detections = read(f"sampler:{RADAR}:car", 3 * DETECTIONS, 2)
    found: list[Sided] = []
    for name, chosen in SIDES.items():
        part = rows(detections, np.flatnonzero(chosen(detections.aspect))[:DETECTIONS])
        for visibility in ("rays", "none"):
            next_step(f"learn from {name}, {visibility}")
            options = OfflineLearning(visibility=visibility, mirrored=False, iterations=40)
            found.append(Sided(name, visibility, *fit_spline(part, options, name), part.u / 2))
    return found


def rows(detections: TrainingDetections, index: NDArray) -> TrainingDetections:
    """Some of the detections."""
    return detections._replace(
        **{
            name: getattr(detections, name)[index]
            for name in ("u", "aspect", "noise", "scan", "size")
            if getattr(detections, name) is not None
        }
    )


def overlap(model: SplineModel, body: NDArray) -> float:
    """IoU of the drawn contour of a model with the true outline body (C, 2) in the unit frame."""
    return float(contour_iou(outlines(model.p, model.Sigma, 1.0), body))


def courses(
    filters: Mapping[str, Any], seeds: int, duration: float, next_step: NextStep
) -> dict[tuple[str, str], list[Row]]:
    """Summaries by scenario and variant, one a seed: every run is recorded once, and replayed."""
    found: dict[tuple[str, str], list[Row]] = {}
    for scenario in COURSES:
        for seed in range(seeds):
            next_step(f"{scenario}, seed {seed}")
            recording = record(scenario, seed, RADAR, duration)
            for name, filter in filters.items():
                found.setdefault((scenario, name), []).append(summary(recording, filter))
    return found


def summary(recording: Recording, filter: Any) -> Row:
    """Figures of the multi-object tracker with a filter on a recording."""
    tracker = MultiObjectTracker(filter, sensors.find(RADAR).models, road=recording.road)
    tracks, evaluator = tracker.start(), Evaluator(recording.scenario)
    for frame in recording.frames:
        tracks, info = tracker.step(tracks, frame.scan, frame.scene.dt)
        evaluator.step(frame.scene.time, frame.scene, frame.origin, tracks, info.owner)
    return evaluator.summary()


def tracked_table(found: Tracked, kind: str) -> str:
    """One row a view and variant."""
    body = [
        (view, name, *(figures[key].text(1 if key == "nees" else 2) for key in MEASURES))
        for (own, view, name), figures in found.items()
        if own == kind
    ]
    return markdown_table(("view", "visibility", *MEASURES.values()), body)


def overall(found: Tracked) -> dict[str, dict[str, dict[str, tuple[float, float]]]]:
    """Means over the classes by variant, measure and view, of magnitudes for biases: what the figure shows."""
    names, views = dict.fromkeys(key[2] for key in found), dict.fromkeys(key[1] for key in found)
    return {name: {m: {view: _over_kinds(found, view, name, m) for view in views} for m in DRAWN} for name in names}


def _over_kinds(found: Tracked, view: str, name: str, key: str) -> tuple[float, float]:
    own = [figures[key] for (_, v, n), figures in found.items() if (v, n) == (view, name)]
    value = np.mean([abs(f.value) if key in ("along", "across", "length") else f.value for f in own])
    return float(value), float(np.sqrt(np.sum([f.half**2 for f in own])) / len(own))


def sided_table(found: Sequence[Sided], body: NDArray) -> str:
    """One row a choice of sides."""
    lines = [
        (s.sides, s.visibility, str(len(s.z)), f"{overlap(s.model, body):.2f}", f"{drawn_length(s.model):.2f}")
        for s in found
    ]
    return markdown_table(("detections from", "visibility", "number", "contour IoU", "length of the contour"), lines)


def drawn_length(model: SplineModel) -> float:
    """Length of the drawn contour in lengths of the vehicle."""
    return float(np.ptp(outlines(model.p, model.Sigma, 1.0)[:, 0]))


def course_table(found: Mapping[tuple[str, str], Sequence[Row]]) -> str:
    """One row a scenario and variant, means over the seeds; they are too few for intervals."""
    body = []
    for (scenario, name), summaries in found.items():
        means = ((np.mean([float(row[key]) for row in summaries]), METRICS[key].digits) for key in COLUMNS)
        body.append((scenario, name, *(f"{value:.{digits}f}" for value, digits in means)))
    return markdown_table(("scenario", "tracker", *(METRICS[key].title for key in COLUMNS)), body)


class Study(NamedTuple):
    """All that the page shows."""

    sided: Sequence[Sided]
    tracked: Tracked
    courses: Mapping[tuple[str, str], Sequence[Row]]
    runs: int
    seeds: int
    duration: float  # [s]


def render(study: Study) -> str:
    """What the page says about a study."""
    return fill(
        "partial_view/page.md.j2",
        radar=RADAR,
        detections=DETECTIONS,
        sided=sided_table(study.sided, CONTOURS["car"].points),
        runs=study.runs,
        step=STEP,
        since=SINCE * STEP,
        tables="\n\n".join(f"### {kind}\n\n{tracked_table(study.tracked, kind)}" for kind in KINDS),
        courses="` and `".join(COURSES),
        duration=study.duration,
        seeds=study.seeds,
        course=course_table(study.courses),
    )


def panels(found: Sequence[Sided], body: NDArray) -> list[list[ContourPanel]]:
    """What the figure of contours shows: a row each for rays and none."""
    return [
        [
            ContourPanel(s.model, s.z, s.learned.counts, f"{s.sides}, {s.visibility}: IoU {overlap(s.model, body):.2f}")
            for s in found
            if s.visibility == visibility
        ]
        for visibility in ("rays", "none")
    ]


def study(runs: int, seed: int, seeds: int, duration: float, next_step: NextStep) -> Study:
    """Everything that the page shows."""
    filters = variants(learned_models("rays", next_step), learned_models("none", next_step), runs)
    sided = from_sides(next_step)
    single = tracked(filters, runs, seed, next_step)
    own = {name: filters[name] for name in ("rays", "none", REFERENCE)}
    own[ADAPTED] = replace(filters[ADAPTED], at_once=1)
    return Study(sided, single, courses(own, seeds, duration, next_step), runs, seeds, duration)


def main(
    docs: Docs = DOCS,
    runs: Annotated[int, typer.Option(min=2, help="Runs of one vehicle in each view.")] = 12,
    seed: Annotated[int, typer.Option(min=0, help="Of those runs.")] = 0,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each course of Yao et al., from 0 on.")] = 2,
    duration: Annotated[float, typer.Option(min=5.0, help="Of each of these [s].")] = 60.0,
) -> None:
    """Track and learn from one side with and without weights by visibility, and write partial-view.md with figures.

    Example: PYTHONPATH=docs python -m studies partial-view --runs 4 --duration 10
    """
    with user_input():
        page = Page("partial-view", docs)
    with steps(4 + 2 * len(SIDES) + len(KINDS) * len(encounters()) + len(COURSES) * seeds) as next_step:
        found = study(runs, seed, seeds, duration, next_step)
    body = CONTOURS["car"].points
    draw_learned(panels(found.sided, body), body, page.picture("partial-view-learned"))
    shown = {name: means for name, means in overall(found.tracked).items() if MIXED not in name}
    draw_tracked(shown, DRAWN, page.picture("partial-view"))
    page.write(render(found))
