"""What filters take in, and what their updates may return."""

from functools import wraps
from typing import NamedTuple

import numpy as np
import pytest

from trackers import TRACKERS, RandomMatrix, Scan, SensorModel, build, find, prior, validation
from trackers.batch import stack
from trackers.filter import UpdateInfo
from trackers.linalg import floored
from trackers.validation import LARGEST, MAX_RANGE, MAX_STEP, admit, guarded_update, unguarded

NAN, INF = np.nan, np.inf
XY = np.array([[20.0, 3.0], [21.0, 3.5], [22.0, 2.5]])


def scan_of(**change):
    """Three detections by one radar, all of it known."""
    polar = np.stack([np.hypot(*XY.T), np.arctan2(XY[:, 1], XY[:, 0]), [-1.0, -1.1, -0.9]], -1)
    known = Scan(polar, np.ones(3, bool), np.zeros((3, 3)), np.zeros((3, 2)), np.full((3, 3), 0.1), np.zeros(3, int))
    return known._replace(**change)


def put(field, row, column, number):
    """The scan with one number of a field replaced."""
    value = getattr(scan_of(), field).copy()
    value[row, column] = number
    return scan_of(**{field: value})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"polar": np.zeros((3, 2))}, r"scan\.polar must be \(\.\.\., M, 3\)"),
        ({"polar": [[1.0, 0.0, 0.0]] * 3}, r"scan\.polar must be an array of real numbers, got list"),
        ({"polar": np.zeros((3, 3), complex)}, r"scan\.polar must be an array of real numbers, got complex128"),
        ({"polar": np.ones((2, 3, 3))}, r"scan\.polar has leading axes \(2,\), the objects have \(\)"),
        ({"mask": np.ones(3)}, r"scan\.mask must be an array of booleans, got float64"),
        ({"mask": np.array(True)}, r"with mask \(\.\.\., M\), got \(3, 3\) and \(\)"),
        ({"pose": np.zeros((2, 3))}, r"scan\.pose must be"),
        ({"velocity": np.zeros(2)}, r"scan\.velocity must be"),
        ({"noise": None}, r"scan\.noise must be an array of real numbers, got NoneType"),
        ({"sensor": np.zeros(1)}, r"scan\.sensor must be an array of integers, got float64"),
        ({"platform": np.zeros(3)}, r"scan\.platform must be \(\.\.\., 6\)"),
        ({"platform": np.full(6, NAN)}, "ego motion is missing"),
        ({"platform": np.full(6, 1e8)}, r"scan\.platform must be finite and plausible"),
        ({"polar": np.full((3, 3), NAN)}, r"scan\.polar is not finite for 3 detections under the mask"),
    ],
)
def test_a_scan_that_cannot_be_used_is_named(change, message):
    with pytest.raises(ValueError, match=message):
        admit(scan_of(**change), ())


@pytest.mark.parametrize("number", [NAN, INF, -INF])
@pytest.mark.parametrize(("field", "width"), [("polar", 3), ("pose", 3), ("velocity", 2), ("noise", 3)])
def test_a_number_that_is_not_finite_is_named_unless_it_may_be_unknown(field, width, number):
    for column in range(width):
        scan = put(field, 1, column, number)
        if np.isnan(number) and (field == "noise" or (field, column) == ("polar", 2)):
            got = admit(scan, ())
            assert got.implausible == 0
            assert got.scan is scan
        else:
            with pytest.raises(ValueError, match=rf"scan\.{field} is not finite for 1 detections"):
                admit(scan, ())


@pytest.mark.parametrize(
    ("field", "column", "number"),
    [
        ("polar", 0, -0.1),
        ("polar", 0, 2 * MAX_RANGE),
        ("polar", 1, 1e5),
        ("polar", 2, 1e9),
        ("pose", 0, 1e9),
        ("velocity", 1, -1e4),
        ("noise", 0, -0.1),
        ("noise", 1, 1e9),
    ],
)
def test_an_implausible_detection_is_masked_and_counted_and_its_number_gone(field, column, number):
    got = admit(put(field, 1, column, number), ())
    assert got.implausible == 1
    np.testing.assert_array_equal(got.scan.mask, [True, False, True])
    assert getattr(got.scan, field)[1, column] == 0
    for name in Scan._fields[2:]:
        if getattr(got.scan, name) is None:
            continue
        np.testing.assert_array_equal(getattr(got.scan, name)[[0, 2]], getattr(scan_of(), name)[[0, 2]][: len(XY)])


def test_one_implausible_sensor_of_all_detections_masks_them_all():
    got = admit(scan_of(pose=np.array([[1e9, 0.0, 0.0]])), ())
    assert got.implausible == 3
    assert not got.scan.mask.any()


def test_padding_may_hold_anything_and_an_ordinary_scan_comes_as_it_is():
    scan = scan_of()
    assert admit(scan, ()).scan is scan
    padded = scan._replace(mask=np.array([True, False, True]), pose=np.array([[0.0] * 3, [NAN] * 3, [0.0] * 3]))
    got = admit(padded, ())
    assert got.implausible == 0
    assert np.isfinite(got.scan.pose).all()


@pytest.mark.parametrize("name", TRACKERS)
def test_an_update_says_what_it_left_out_and_of_which_object(name):
    f = find(name)
    state = f.init(prior([[21.0, 3.0, 0.1], [21.0, 3.0, 0.1]], velocity=(10.0, 0.0)))
    one, bad = scan_of(), put("polar", 1, 2, 1e9)
    scan = stack([one, bad])
    _, info = f.update(state, scan)
    np.testing.assert_array_equal(info.n, [3, 2])
    (note,) = (note for note in info.notes if note.kind == "implausible")
    np.testing.assert_array_equal(note.where, [False, True])
    _, known = f.update(state, scan._replace(mask=np.array([[True] * 3, [True, False, True]])))
    np.testing.assert_array_equal(info.eps, known.eps)


@pytest.mark.parametrize("name", TRACKERS)
def test_time_steps_of_no_use_are_named(name):
    f = find(name)
    state = f.init(prior((21.0, 3.0, 0.1)))
    for dt in (-0.1, NAN, INF, MAX_STEP + 1):
        with pytest.raises(ValueError, match="dt must be finite, >= 0 and at most 60 s"):
            f.predict(state, dt)
    assert np.isfinite(f.estimate(f.predict(state, MAX_STEP)).cov).all()


def test_an_object_whose_update_is_of_no_use_keeps_its_state_and_the_others_do_not():
    f, scan = find("rm-feldmann"), scan_of()
    state = f.init(prior([[21.0, 3.0, 0.1]] * 3, velocity=(10.0, 0.0)))
    far = state.m.copy()
    far[1] *= LARGEST
    state = state._replace(m=far)
    both = stack([scan] * 3)
    new, info = f.update(state, both)
    np.testing.assert_array_equal(info.n, [3, 0, 3])
    (note,) = info.notes
    assert note.kind == "skipped"
    np.testing.assert_array_equal(note.where, [False, True, False])
    for got, before in zip(new, state, strict=True):
        np.testing.assert_array_equal(got[1], before[1])
    alone, _ = f.update(f.init(prior([21.0, 3.0, 0.1], velocity=(10.0, 0.0))), scan)
    np.testing.assert_array_equal(new.m[0], alone.m)


def test_an_object_without_a_detection_keeps_every_bit_of_a_covariance_that_is_not_definite():
    f = find("rm-feldmann")
    state = f.init(prior([[21.0, 3.0, 0.1]] * 2, velocity=(10.0, 0.0)))
    P = state.P.copy()
    P[1, 4, 4] = 0.0  # certain of its yaw rate
    scan = stack([scan_of()] * 2)._replace(mask=np.array([[True] * 3, [False] * 3]))
    new, _ = f.update(state._replace(P=P), scan)
    np.testing.assert_array_equal(new.P[1], P[1])
    assert (np.linalg.eigvalsh(new.P[0]) > 0).all()


def test_the_size_of_an_object_outlasts_minutes_without_a_detection():
    f = find("rm-feldmann")
    state = f.init(prior([21.0, 3.0, 0.0], size=(4.6, 1.9)))
    for _ in range(10):
        state = f.predict(state, 30.0)
    np.testing.assert_allclose(f.estimate(state).size, [4.6, 1.9], rtol=1e-5)


def test_detections_of_something_else_do_not_make_a_body_of_kilometres():
    f = find("htg-map")
    state = f.init(prior([21.0, 3.0, 0.1], velocity=(10.0, 0.0), size=(5e3, 5e3), size_std=(1.0, 1.0)))
    new, _ = f.update(state, scan_of())
    assert (f.estimate(new).size <= 1000.0 * (1 + 1e-12)).all()


class Centre(NamedTuple):
    """Gaussian of a position."""

    m: np.ndarray  # (..., 2)
    P: np.ndarray  # (..., 2, 2)


class Exact:
    """Filter of positions that takes detections for exact; a position that is known exactly has no update."""

    @guarded_update
    def update(self, state: Centre, scan: Scan) -> tuple[Centre, UpdateInfo]:
        n = scan.mask.sum(-1)
        eps, S = np.zeros_like(state.m), np.zeros_like(state.P) + np.eye(2)
        mean = np.where(scan.mask[..., None], scan.xy, 0).sum(-2) / np.maximum(n, 1)[..., None]
        eps[n > 0], S[n > 0] = (mean - state.m)[n > 0], state.P[n > 0]
        K = state.P @ np.linalg.inv(S)
        return Centre(state.m + (K @ eps[..., None])[..., 0] * (n > 0)[..., None], state.P), UpdateInfo(n, eps, S)


def test_one_singular_matrix_does_not_cost_the_others_their_update():
    P = np.stack([np.eye(2), np.zeros((2, 2)), np.eye(2)])
    state, scan = Centre(np.zeros((3, 2)), P), stack([scan_of()] * 3)
    new, info = Exact().update(state, scan)
    np.testing.assert_array_equal(info.n, [3, 0, 3])
    np.testing.assert_allclose(new.m, [XY.mean(0), [0, 0], XY.mean(0)])
    assert [(note.kind, note.where.tolist()) for note in info.notes] == [("skipped", [False, True, False])]


def test_a_covariance_that_rounding_made_indefinite_is_definite_again_and_others_keep_every_bit():
    rng = np.random.default_rng(3)
    A = rng.standard_normal((4, 3, 3))
    P = A @ A.mT
    broken = P.copy()
    value, vector = np.linalg.eigh(P[2])
    broken[2] = (vector * [-1e-15, value[1], value[2]]) @ vector.T
    got = floored(broken, P)
    assert (np.linalg.eigvalsh(got) > 0).all()
    np.testing.assert_array_equal(got[[0, 1, 3]], P[[0, 1, 3]])
    np.testing.assert_allclose(got[2], broken[2], atol=1e-10)
    assert floored(P, P) is P


class Two(NamedTuple):
    """The state of a filter that holds that of another."""

    m: np.ndarray
    inner: NamedTuple


class Outer:
    """A filter that passes its scan on."""

    def __init__(self, inner):
        self.inner = inner

    @guarded_update
    def update(self, state, scan):
        inner, info = unguarded(self.inner.update)(state.inner, scan)
        return Two(inner.m, inner), info


def test_a_filter_inside_another_does_not_examine_the_scan_again(monkeypatch):
    f = find("rm-feldmann")
    start = f.init(prior([[21.0, 3.0, 0.1]] * 3, velocity=(10.0, 0.0)))
    far = start.m.copy()
    far[1] *= LARGEST
    start = start._replace(m=far)
    outer, scan = Outer(f), stack([scan_of()] * 3)
    state, info = outer.update(Two(start.m, start), scan)
    alone, _ = f.update(start, scan)
    for got, want in zip(state.inner, alone, strict=True):
        np.testing.assert_array_equal(got, want)
    assert [note.kind for note in info.notes] == ["skipped"]
    examined = []
    monkeypatch.setattr(validation, "check_fields", lambda *of: examined.append(of))
    outer.update(Two(start.m, start), scan)
    assert len(examined) == 1


@pytest.mark.parametrize("name", ["rm-koch", "rm-vmm", "pmht-spline-adaptive", "imm-spline"])
def test_a_tracker_examines_a_scan_once_whatever_its_filter_is_made_of(name, monkeypatch):
    monkeypatch.setattr("trackers.multi.tracker.available", lambda: False)  # the compiled form looks at numbers first
    tracker = build(name, (SensorModel(fov=7.0),))
    tracks = tracker.start()
    for k in range(3):
        tracks, _ = tracker.step(tracks, scan_of(), 0.1 if k else 0.0)
    assert len(tracks.id) == 1
    examined = []
    monkeypatch.setattr(validation, "check_fields", lambda *of: examined.append(of))
    tracks, info = tracker.step(tracks, scan_of(), 0.1)
    assert info.detections.sum() == 3
    assert len(examined) == 1


class Plain:
    """A user's filter of positions, without validation of its own."""

    def init(self, estimate):
        return Centre(estimate.pose[..., :2], estimate.cov[..., :2, :2])

    def update(self, state, scan):
        raise np.linalg.LinAlgError("a bug of the user")


def test_a_filter_without_the_decorator_is_called_as_it_is():
    f = Plain()
    with pytest.raises(np.linalg.LinAlgError, match="a bug of the user"):
        validation.guarded(f.update, f.init(prior([[21.0, 3.0, 0.1]])), scan_of())


def test_a_method_that_a_user_has_wrapped_again_keeps_the_wrapping():
    calls = []

    class Counted(RandomMatrix):
        @wraps(RandomMatrix.update)
        def update(self, state, scan):
            calls.append(scan)
            return super().update(state, scan)

    f = Counted()
    state = f.init(prior([[21.0, 3.0, 0.1]]))
    new, _ = validation.guarded(f.update, state, stack([scan_of()]))
    assert len(calls) == 1
    np.testing.assert_array_equal(new.m, RandomMatrix().update(state, stack([scan_of()]))[0].m)
