"""The reproduction of yao2021: its simulation, its measures and its answers, on small inputs."""

import json

import numpy as np
import pytest
import shapely

from studies.papers.catalogue import PAPERS
from studies.papers.report import Stopped
from studies.papers.yao2021 import experiment as yao2021
from studies.papers.yao2021.claims import above, answers, apart, gain
from studies.papers.yao2021.simulation import (
    BAND,
    CONTOURS,
    NOISE,
    SIZE,
    STEPS,
    B,
    band_points,
    begin,
    pooled,
    simulate,
    track,
    truth,
)  # fmt: skip
from testbed.evaluation.intervals import Interval
from trackers.geometry import to_frame
from trackers.pmht.model import find


def test_the_course_is_a_left_circle_half_a_right_one_and_a_straight():
    x = truth()
    assert len(x) == STEPS
    turn = np.diff(x[:, 2])
    np.testing.assert_allclose(turn[:100], np.pi / 101)
    np.testing.assert_allclose(turn[101:220], -np.pi / 121)
    np.testing.assert_allclose(turn[222:], 0)
    np.testing.assert_allclose(np.linalg.norm(np.diff(x[:, :2], axis=0), axis=1), 11.2, rtol=1e-3)


@pytest.mark.parametrize("name", CONTOURS)
def test_detections_are_uniform_in_the_band_inside_the_contour(name):
    body = shapely.Polygon(CONTOURS[name])
    z = band_points(CONTOURS[name], 4000, np.random.default_rng(0))
    d = shapely.distance(shapely.points(z), body.exterior)
    assert shapely.contains_xy(body.buffer(1e-9), z).all()
    assert d.max() <= BAND * np.sqrt(2)
    assert d.mean() == pytest.approx(BAND / 2, abs=0.01)
    front = band_points(CONTOURS[name], 4000, np.random.default_rng(0))[:, 0] > 0
    halves = [body.difference(body.buffer(-BAND, join_style="mitre")).intersection(shapely.box(a, -2, b, 2)).area
              for a, b in ((-3, 0), (0, 3))]  # fmt: skip
    assert front.mean() == pytest.approx(halves[1] / sum(halves), abs=0.03)


def test_detections_lie_on_the_contour_in_every_run():
    d = simulate(CONTOURS["truck"], 3, np.random.default_rng(1))
    body = to_frame(d.x[:, None, :3], d.xy)[d.mask]
    assert (np.abs(body) <= SIZE / 2 + 5 * NOISE).all()
    assert d.mask.sum(-1).mean() == pytest.approx(20, abs=0.7)
    again = simulate(CONTOURS["truck"], 3, np.random.default_rng(1))
    np.testing.assert_array_equal(d.xy, again.xy)


def test_joint_and_sequential_updates_track_alike():
    d = simulate(CONTOURS["tractor"], 8, np.random.default_rng(2))
    model, errors = find("yao2021"), {}
    for method in (B, yao2021.A):
        f = method.filter(model)
        _, forward = track(f, d, begin(f, 8), 0, 40)
        errors[method.name] = np.sqrt(((forward.m[..., :2] - d.x[:40, None, :2]) ** 2).sum(-1).mean())
    assert errors["B"] == pytest.approx(errors["A"], rel=0.05)


def test_pooling_keeps_runs_apart():
    z = np.arange(2 * 3 * 4 * 2.0).reshape(2, 3, 4, 2)
    mask = z[..., 0] > 10
    together, kept = pooled(z, mask)
    np.testing.assert_array_equal(together[1], np.concatenate([z[0, 1], z[1, 1]]))
    np.testing.assert_array_equal(kept[1], np.concatenate([mask[0, 1], mask[1, 1]]))


def test_a_gain_is_a_ratio_of_errors_with_its_interval():
    g = gain(np.full(20, 4.0), np.full(20, 1.0))
    assert (g.value, g.low, g.high) == pytest.approx((2, 2, 2))
    rng = np.random.default_rng(3)
    wide = gain(rng.uniform(1, 7, 20), np.full(20, 1.0))
    assert wide.low < wide.value < wide.high


def test_a_bar_inside_an_interval_decides_nothing():
    assert above(Interval(1.5, 1.4, 1.6), 1.3)
    assert above(Interval(1.2, 1.1, 1.25), 1.3) is False
    assert above(Interval(1.35, 1.25, 1.45), 1.3) is None


def test_two_gains_are_as_far_apart_whichever_comes_first():
    a, b = Interval(2.0, 1.6, 2.5), Interval(3.0, 2.4, 3.75)
    assert apart(a, b) == apart(b, a)
    assert apart(a, b).value == pytest.approx(1.5)
    assert apart(a, b).high / 1.5 == pytest.approx(1.25 ** np.sqrt(2))
    assert apart(a, a).value == 1


@pytest.mark.slow
def test_the_whole_experiment_with_two_runs(tmp_path):
    """Every method has every stage, the figures are drawn and the answers given."""
    report = yao2021.run(runs=2, out=tmp_path, seed=3)
    assert len(report.rows) == 2 * 3 * 4
    assert {v.outcome.split()[0] for v in report.answers} <= {"confirmed", "not"}
    row = report.row("tractor", "B adapted")
    assert row["position m"] < 0.1 < report.row("tractor", "B not adapted")["position m"]
    assert row["IoU"] > 0.85
    assert np.isnan(report.row("truck", "A smoothed")["lost"])
    assert all(path.stat().st_size > 10_000 for path in report.figures)
    assert json.loads((tmp_path / "yao2021.json").read_text())["paper"] == "yao2021"


def test_an_early_end_keeps_every_stage_of_the_methods_that_are_done(tmp_path):
    def stop(done, total, what):
        if done >= 1:
            raise Stopped

    cut = PAPERS["yao2021"].run(runs=1, out=tmp_path, progress=stop, seed=3)
    assert cut.interrupted
    assert [row.method for row in cut.rows] == ["A before", "A smoothed", "A not adapted", "A adapted"]
    assert cut.cases == ("truck",)
    row = cut.row("truck", "A adapted")
    assert row["position m"] < 0.1 < cut.row("truck", "A not adapted")["position m"]
    assert row["IoU"] > 0.85
    assert np.isnan(cut.row("truck", "A smoothed")["lost"])
    assert not cut.answers + cut.figures
    assert json.loads((tmp_path / "yao2021.json").read_text())["interrupted"]


def test_claims_follow_from_the_figures():
    """Large gains by the adaptation confirm every claim."""
    stages = {"before": 4.0, "smoothed": 3.0, "not adapted": 4.0, "adapted": 1.0}
    squares = {s: dict.fromkeys(yao2021.COLUMNS, np.full(5, v)) for s, v in stages.items()}
    good = {s: {c: v / (9 if s == "adapted" else 1) for c, v in cols.items()} for s, cols in squares.items()}
    all_squares = {(c, m): good if m == "B" else squares for c in CONTOURS for m in ("A", "A, 4 Sigma", "B")}
    assert [v.outcome for v in answers(all_squares)] == ["confirmed"] * 4
