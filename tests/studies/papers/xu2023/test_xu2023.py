"""The reproduction of xu2023: its maneuvers, its measures and its answers, on small inputs."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student

from studies.papers.answer import CONFIRMED, REFUTED
from studies.papers.catalogue import PAPERS
from studies.papers.report import Stopped
from studies.papers.xu2023 import experiment as xu2023
from studies.papers.xu2023 import figures
from studies.papers.xu2023.cases import METHODS, NEAR, READINGS, SWEEPS, VARIED, Sweep, Variant, unprinted
from studies.papers.xu2023.claims import answers, group
from studies.papers.xu2023.measures import COLUMNS, TABLE_2, measure, reduction, rmse, stage_mask, true_modes
from studies.papers.xu2023.simulation import (
    CAR,
    IOU_EVERY,
    NOISE,
    PRIOR_STD,
    STAGES,
    STEPS,
    RunErrors,
    advance,
    detect,
    join,
    maneuver,
    simulate,
    split,
    start,
    track,
)  # fmt: skip
from studies.plus_minus import PlusMinus
from testbed.experiments.engine import Engine
from tests.reproduction.test_xu2023_bars import BARS
from trackers.dra import ProcessNoise
from trackers.dra.state import PLACE, VELOCITY, VERTICES, axes

KEYS = [(sweep.case, v.name) for sweep in SWEEPS for v in sweep.variants]


def constant(errors, share=0.9, runs=4):
    """Runs whose errors (6,), in the order of COLUMNS, are all the same; modes right in a share of steps."""
    position, velocity = np.zeros((2, STEPS, runs))
    for k, stage in enumerate(STAGES):
        position[stage_mask(stage)], velocity[stage_mask(stage)] = errors[2 * k] ** 2, errors[2 * k + 1] ** 2
    wrong = np.arange(STEPS) % 100 >= 100 * share
    mode = np.eye(3)[np.where(wrong, (true_modes() + 1) % 3, true_modes())][:, None].repeat(runs, 1)
    return RunErrors(position, velocity, np.full((STEPS // IOU_EVERY, runs), 0.5), mode)


def table_of(method):
    """Figures of Table II for a method of ours, ones for those that are not the paper's."""
    return TABLE_2.get(method.rsplit(",", 1)[0], (1.0,) * 6)


def test_the_straight_maneuvers_end_at_twenty_metres_per_second_along_x():
    """A check of the start, which the paper does not print."""
    rng = np.random.default_rng(0)
    x = np.repeat(start()[None], 400, 0)
    for k in range(400):
        x = advance(x, k, rng, follows=False)
    np.testing.assert_allclose(x[:, VELOCITY].mean(0), [20, 0], atol=0.5)


def test_the_modes_are_those_of_table_one():
    assert [maneuver(round(t / 0.1))[2] for t in (0, 9.9, 10, 29.9, 30, 39.9, 40, 49.9)] == [0, 0, 1, 1, 0, 0, 2, 2]


@pytest.mark.parametrize("follows", [False, True])
def test_a_turning_body_keeps_its_size_and_its_speed(follows):
    x = np.repeat(start()[None], 3, 0)
    for k in range(400, 420):
        x = advance(x, k, np.random.default_rng(k), follows)
    a = axes(x)
    np.testing.assert_allclose(np.stack([a.length, a.width], -1), np.broadcast_to(CAR, (3, 2)), rtol=1e-9)
    np.testing.assert_allclose(np.hypot(*x[:, VELOCITY].T), 30, atol=1.5)
    np.testing.assert_allclose(x[:, 6], np.pi / 20, atol=0.1)


def test_detections_lie_on_the_body_and_carry_its_velocity():
    x = np.repeat(start()[None], 50, 0)
    radar = x.copy()
    radar[:, PLACE] += [-20.0, -10.0]
    scan = detect(x, radar, np.random.default_rng(0))
    d = np.abs(scan.xy - x[:, None, PLACE])[scan.mask]
    assert (d <= CAR / 2 + 5 * NOISE[0] + 5 * 23 * NOISE[1]).all()
    assert np.abs(scan.polar[..., 2][scan.mask]).max() < 5 * NOISE[2]  # both drive at 30 m/s


def test_the_same_seed_gives_the_same_errors_and_every_method_the_same_world():
    offset, std = np.tile(NEAR, (2, 1)), np.tile(PRIOR_STD, (2, 1))
    runs = [list(islice(track(METHODS[m], offset, std, 7), 3)) for m in ("literal", "literal", "DRA(CV), V")]
    for a, b in zip(runs[0], runs[1], strict=True):
        for x, y in zip(a, b, strict=True):
            np.testing.assert_array_equal(x, y)
    np.testing.assert_array_equal(runs[0][2].truth, runs[2][2].truth)
    first, again = (next(simulate(offset, False, np.random.default_rng(3))) for _ in range(2))
    np.testing.assert_array_equal(first.scan.polar, again.scan.polar)
    assert runs[2][0].mode.shape == (2, 1)


def test_variants_start_where_they_say_and_change_nothing_else():
    a, b = Variant("a"), Variant("b", blur=2.0, vertex_std=0.1)
    np.testing.assert_array_equal(a.prior_std, PRIOR_STD)
    np.testing.assert_array_equal(b.prior_std[VERTICES], 0.1)
    np.testing.assert_array_equal(b.prior_std[:7], 2 * PRIOR_STD[:7])
    names = [v.name for v in unprinted()]
    assert len(set(names)) == len(names)
    for v in unprinted():
        if "deg" in v.name:
            bearing, distance = (float(part.split()[0]) for part in v.name.split(", "))
            assert np.hypot(*v.offset) == pytest.approx(distance, abs=0.1)
            assert np.degrees(np.arctan2(-v.offset[1], -v.offset[0])) == pytest.approx(bearing, abs=0.1)


def test_batches_cover_all_runs_and_no_row_has_more_than_it_may():
    for runs in (1, 49, 50, 51, 130):
        for sweep in SWEEPS:
            numbers = [n for _, n in xu2023.batches((sweep,), runs)]
            sizes = [min(xu2023.BATCH, sweep.runs(runs) - n * xu2023.BATCH) for n in numbers]
            assert min(sizes) > 0
            assert sum(sizes) == sweep.runs(runs) == min(runs, sweep.most or runs)
    assert len(set(KEYS)) == len(KEYS)


def test_runs_that_are_split_join_again():
    rng = np.random.default_rng(0)
    whole = RunErrors(*(rng.random((4, 6, *tail)) for tail in ((), (), (), (3,))))
    for a, b in zip(join(split(whole, 3)), whole, strict=True):
        np.testing.assert_array_equal(a, b)


def test_stages_cover_all_steps_once_and_the_measures_are_averages_over_them():
    masks = [stage_mask(stage) for stage in STAGES]
    np.testing.assert_array_equal(np.sum(masks, 0), np.ones(STEPS))
    squared = np.zeros((STEPS, 4))
    squared[masks[1]] = [1.0, 1, 9, 9]
    assert rmse(squared, "CA").value == pytest.approx(np.sqrt(5))
    assert rmse(squared, "CV").value == 0
    influence = np.array([-4, -4, 4, 4]) / (2 * np.sqrt(5))
    assert rmse(squared, "CA").half == pytest.approx(student.ppf(0.975, 3) * np.std(influence, ddof=1) / 2)
    assert np.isnan(rmse(squared[:, :1], "CA").half)
    row = measure(constant((1, 2, 3, 4, 5, 6), share=0.8))
    assert [row[c] for c in COLUMNS] == pytest.approx([1, 2, 3, 4, 5, 6])
    assert (row["mode"], row["IoU"], row["CT mode"], row["runs"]) == pytest.approx((0.8, 0.5, 0.8, 4))
    single = constant((1,) * 6)
    assert np.isnan(measure(single._replace(mode=single.mode[..., :1]))["mode"])


def test_ninety_five_percent_of_the_intervals_hold_the_truth():
    """2000 experiments of 60 runs; two-sided, four standard deviations of the share are .02. Halves hold far less."""
    rng = np.random.default_rng(5)
    scale = np.linspace(1, 3, STEPS)[:, None]  # errors grow; runs are correlated over time
    held = np.empty((2, 2000), bool)
    for k in range(held.shape[1]):
        squared = (scale * rng.standard_normal((5, 60)).repeat(STEPS // 5, 0)) ** 2
        value, half = rmse(squared, "CA")
        off = abs(value - scale[stage_mask("CA")].mean())
        held[:, k] = off < half, off < half / 2
    assert 0.92 < held[0].mean() < 0.97
    assert held[1].mean() < 0.75


@given(st.floats(0.1, 0.9), st.integers(0, 2**32))
def test_a_method_that_is_better_by_a_factor_in_every_run_has_a_certain_reduction(factor, seed):
    squared = np.random.default_rng(seed).exponential(size=(STEPS, 5))
    value, half = reduction(squared, factor**2 * squared, "CT")
    assert value == pytest.approx(100 * (1 - factor))
    assert half == pytest.approx(0, abs=1e-9)


def test_an_interval_that_holds_zero_decides_nothing():
    assert [PlusMinus(v, 1.0).positive for v in (2.0, 0.5, -0.5, -2.0)] == [True, None, None, False]


def test_the_table_s_own_figures_confirm_its_claims_and_rows_exist_for_all_of_them():
    runs = {
        (case, name): constant(table_of(case.removeprefix(VARIED) if case.startswith(VARIED) else name))
        for case, name in KEYS
    }
    found = answers({key: measure(errors) for key, errors in runs.items()}, runs)
    assert [v.outcome for v in found] == [CONFIRMED] * 8 + [REFUTED]
    assert "CA 23 ± 0 / 45 ± 0, CT 15 ± 0 / 15 ± 0" in found[0].numbers
    assert "(paper CA 23 / 45, CT 15 / 15)" in found[0].numbers
    assert PAPERS["xu2023"].run is xu2023.run
    assert {group(v) for c, v in KEYS if c.startswith(VARIED)} == {
        "radar's course", "transition matrix", "first estimate"
    }  # fmt: skip


def test_reading_s_takes_the_numbers_of_yaw_rate_and_vertices_as_standard_deviations():
    assert READINGS["V"].ct == ProcessNoise(0.25, 1e-6, 1e-4)
    assert READINGS["S"].ct.accel == 0.25
    assert READINGS["S"].ct.yaw_rate == pytest.approx(1e-12)
    assert READINGS["S"].ct.vertex == pytest.approx(1e-8)


def test_the_bars_are_of_rows_of_the_reproduction_but_for_the_slow_ones():
    assert {key for key in BARS if not key[1].endswith("joint")} <= set(KEYS)


def test_few_runs_are_near_the_bars_and_the_same_on_two_processes():
    """Eight runs: 2.5 times the bands of fifty."""
    (sweep,) = (s for s in SWEEPS if (s.case, s.variants[0].name) == ("near", "literal"))
    runs = xu2023.ManeuverRuns()
    xu2023.experiment(8, 3, runs, sweeps=(sweep, replace(sweep, case="again")), engine=Engine(2))
    bar, row = BARS["near", "literal"], runs.rows[0].measured
    found = np.array([row[c] for c in COLUMNS])
    assert (np.abs(found - bar.errors) < 2.5 * np.array(bar.bands)).all(), found
    assert [row[f"{s} IoU"] for s in STAGES] == pytest.approx(bar.iou, abs=0.05)
    assert [row[f"{s} mode"] for s in STAGES] == pytest.approx(bar.mode, abs=0.05)
    for a, b in zip(runs.errors["near", "literal"], runs.errors["again", "literal"], strict=True):
        np.testing.assert_array_equal(a, b)


def test_all_rows_have_their_figures(tmp_path):
    runs = xu2023.ManeuverRuns()
    for case, name in KEYS:
        runs.add(case, name, constant(table_of(name)))
    assert [(row.case, row.method) for row in runs.rows] == KEYS
    paths = figures.draw(runs.errors, tmp_path)
    assert len(paths) == 3
    assert all(path.exists() for path in paths)


def test_a_stopped_experiment_keeps_its_finished_rows():
    def stop(*_):
        raise Stopped

    sweeps = tuple(Sweep(case, METHODS["literal"], (Variant("literal"),)) for case in ("near", "never"))
    runs = xu2023.ManeuverRuns()
    with pytest.raises(Stopped):
        xu2023.experiment(1, 0, runs, stop, sweeps)
    assert [(row.case, row.method) for row in runs.rows] == [("near", "literal")]
