"""The compiled kernels against the numpy form, on recorded scans and on drawn ones; and how a form is chosen."""

import os
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sensors.rigs import RADARS
from testbed.check.draws import check_equal, random_prior, random_scan
from testbed.files import versions
from tests.testbed.evaluation.road_world import CAR, RATE, TRUCK, Vehicle, World, record
from trackers import build, compiled, find
from trackers.size.ends import Ends

NUMBA = pytest.mark.skipif(find_spec("numba") is None, reason="numba, of the extra fast, is not installed")
PLACES = [(-2, -1, TRUCK), (4, 1, CAR), (18, 0, TRUCK), (-15, 0, CAR), (14, -1, CAR), (-3, -2, CAR), (9, -2, CAR)]
WORLD = World(tuple(Vehicle(s, lane, 24.0 + 2 * lane, size) for s, lane, size in PLACES))
CLOSE = {"rtol": 1e-9, "atol": 1e-9}  # sums in another order
EXAMPLES = settings(max_examples=15, deadline=None)  # the first one may compile


@pytest.fixture(autouse=True)
def _environment():
    """The form of other tests is as before."""
    before = os.environ.get(compiled.SWITCH)
    yield
    if before is None:
        compiled.use(True)
        del os.environ[compiled.SWITCH]
    else:
        compiled.use(before != "0")


def both(work):
    """What a function returns in the numpy form and in the compiled one."""
    found = []
    for form in (False, True):
        compiled.use(form)
        found.append(work())
    return found


def test_numpy_is_the_form_without_numba_and_where_it_is_switched_off(monkeypatch):
    compiled.use(False)
    assert compiled.kernels("spline") is None
    assert "numba" not in versions()
    compiled.use(True)
    monkeypatch.setattr(compiled, "_loaded", {})
    monkeypatch.setattr(compiled, "find_spec", lambda name: None)
    assert compiled.kernels("spline") is None
    assert "numba" not in versions()


@NUMBA
def test_results_name_the_kernels_that_made_them():
    compiled.use(True)
    assert {"numba", "trackers.compiled"} <= versions().keys()
    assert compiled.kernels("algebra") is not None


def test_rows_broadcasts_and_never_hands_out_what_is_read_only():
    shared = np.arange(6.0).reshape(2, 3)
    rows = compiled.rows(shared, (4,), 2, 3)
    assert rows.shape == (4, 2, 3)
    assert np.array_equal(rows[3], shared)
    frozen = np.zeros((1, 3))
    frozen.flags.writeable = False
    assert compiled.rows(frozen, (1,), 3).flags.writeable
    assert compiled.rows(np.zeros(3), (), 3).shape == (1, 3)


@NUMBA
@pytest.mark.parametrize("name", ["imm-spline", "imm-htg"])
def test_recorded_scans_give_the_same_tracks_and_decisions(name):
    tracker = build(name, RADARS["surround"].models)
    steps = record(WORLD, 1.5, seed=3, radar=lambda time: RADARS["surround"])

    def run():
        tracks, found = tracker.start(), []
        for _, scan, _ in steps:
            tracks, info = tracker.step(tracks, scan, 1 / RATE)
            found.append((tracks, info))
        return found

    plain, fast = both(run)
    for (a, its), (b, others) in zip(plain, fast, strict=True):
        assert np.array_equal(its.owner, others.owner)
        assert its.events == others.events
        assert np.array_equal(a.id, b.id)
        check_equal(b.estimate, a.estimate, **CLOSE)
    assert len(plain[-1][0].id) >= 5


@NUMBA
@EXAMPLES
@given(seed=st.integers(0, 10_000), lead=st.sampled_from([(), (3,), (2, 2)]), lost=st.booleans())
def test_the_update_of_place_motion_and_size_equals_that_of_numpy(seed, lead, lost):
    rng = np.random.default_rng(seed)
    filter = Ends(build("imm-spline", RADARS["surround"].models).layered.filter)
    state = filter.predict(filter.init(random_prior(rng, lead)), 0.1)
    away = np.array([8.0, -5.0]) if lost else np.zeros(2)
    scan = random_scan(rng, filter.estimate(state).pose[..., :2] + away, lead=lead, missing=bool(seed % 2))
    plain, fast = both(lambda: filter.update(state, scan))
    check_equal(fast[0], plain[0], **CLOSE)
    check_equal((fast[1].eps, fast[1].S, fast[1].mode), (plain[1].eps, plain[1].S, plain[1].mode), **CLOSE)


@NUMBA
def test_a_filter_whose_scans_state_no_noise_and_no_rates_is_the_same():
    rng = np.random.default_rng(5)
    filter = find("pmht-spline")
    state = filter.init(random_prior(rng, (4,)))
    scan = random_scan(rng, state.m[..., :2], lead=(4,))
    scan = scan._replace(noise=np.full_like(scan.noise, np.nan), polar=scan.polar * [1, 1, np.nan])
    plain, fast = both(lambda: filter.update(state, scan)[0])
    check_equal(fast, plain, **CLOSE)
