"""The reproduction of xu2023: its maneuvers, its measures and its verdicts, on small inputs."""

from itertools import islice

import numpy as np
import pytest

from testbed.papers import xu2023
from testbed.papers.catalogue import PAPERS
from testbed.papers.xu2023_claims import verdicts
from testbed.papers.xu2023_reference import COLUMNS, REFERENCE
from testbed.papers.xu2023_trials import (
    CAR,
    NOISE,
    STEPS,
    Course,
    Trace,
    advance,
    detect,
    frames,
    maneuver,
    start,
    track,
)  # fmt: skip
from trackers.dra.state import PLACE, VELOCITY, axes


def test_the_straight_maneuvers_end_at_twenty_metres_per_second_along_x():
    """The card's check of the start that the paper does not print."""
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
    course = Course("near", xu2023.NEAR)
    runs = [list(islice(track(xu2023.METHODS[m], course, 2, 7), 3)) for m in ("literal", "literal", "DRA(CV), V")]
    for a, b in zip(runs[0], runs[1], strict=True):
        for x, y in zip(a, b, strict=True):
            np.testing.assert_array_equal(x, y)
    first, again = (next(frames(course, 2, np.random.default_rng(3))) for _ in range(2))
    np.testing.assert_array_equal(first.scan.polar, again.scan.polar)
    assert runs[2][0][3].shape == (2, 1)


def test_stages_cover_all_steps_once_and_the_measures_are_averages_over_them():
    masks = [xu2023.stage_mask(stage) for stage in xu2023.STAGES]
    np.testing.assert_array_equal(np.sum(masks, 0), np.ones(STEPS))
    squared = np.zeros((STEPS, 4))
    squared[masks[1]] = [1.0, 1, 9, 9]
    assert xu2023.rmse(squared, "CA") == pytest.approx(np.sqrt(5))
    assert xu2023.rmse(squared, "CV") == 0
    assert xu2023.half_width(squared, "CA") == pytest.approx(1.96 * np.std([1, 1, 3, 3], ddof=1) / 2)
    mode = np.eye(3)[xu2023.true_modes()][:, None].repeat(4, 1)
    row = xu2023.measure(Trace(squared, squared, np.full((STEPS, 4), 0.5), mode))
    assert (row["mode"], row["IoU"]) == (1, 0.5)
    assert np.isnan(xu2023.measure(Trace(squared, squared, squared, mode[..., :1]))["mode"])


def test_every_case_has_rows_for_every_claim_and_the_table_s_own_figures_confirm_its_claims():
    results = {
        (c.course.name, m): {**dict.fromkeys(COLUMNS, 1.0), "mode": 0.9} for c in xu2023.CASES for m in c.methods
    }
    results |= {key: {**value, "mode": 0.9} for key, value in REFERENCE.items()}
    answers = verdicts(results)
    assert [v.outcome for v in answers[:5]] == ["confirmed"] * 5
    assert answers[5].outcome == "not confirmed"
    assert "CA 23 / 45" in answers[0].numbers
    assert PAPERS["xu2023"].run is xu2023.run


def test_no_runs_are_refused():
    with pytest.raises(ValueError, match="runs must be at least 1"):
        xu2023.run(runs=0)
