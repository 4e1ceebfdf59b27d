"""The laws of a filter: what the multi-object tracker, the IMM and every comparison rely on.

Each law is a function of a filter that returns where it holds and raises `Broken` where it does not. Keywords choose
the draw (`seed`, `lead`: leading axes; `missing`: a range rate of each object was not measured) and how much of
rounding is allowed (`rtol`, `atol`). The sources of the laws are the protocols of `trackers.filter`.
"""

from typing import Any

import numpy as np

from testbed.check.draws import Broken, arrays, check_equal, check_finite, leaves, random_prior, random_scan
from trackers.batch import select, stack, take
from trackers.estimate import Estimate, prior
from trackers.geometry import rotation, unit, wrap_angle
from trackers.scan import Scan

Lead = tuple[int, ...]
AXES = {"n": (), "eps": (2,), "S": (2, 2)}  # of the information of an update, behind the leading ones
SIZES = {"pose": (3,), "velocity": (2,), "yaw_rate": (), "size": (2,), "cov": (4, 4), "size_std": (2,),
         "heading_std": (), "yaw_rate_std": ()}  # fmt: skip  # of an estimate


def states_have_leading_axes(f: Any, seed: int = 1, lead: Lead = (3, 2)) -> None:
    """A state is a NamedTuple of arrays, an update gives (state, info), and all have the leading axes of the prior."""
    rng = np.random.default_rng(seed)
    start = random_prior(rng, lead)
    state = f.init(start)
    for verb in ("init", "predict", "update"):
        if verb == "predict":
            state = f.predict(state, 0.1)
        if verb == "update":
            pair = f.update(state, random_scan(rng, start.pose, lead=lead))
            if not (type(pair) is tuple and len(pair) == 2):
                raise Broken(f"update returns {type(pair).__name__}; it must return the pair (state, info)")
            state = pair[0]
        if not hasattr(state, "_fields"):
            raise Broken(f"{verb} returns {type(state).__name__}; a state must be a NamedTuple of arrays")
        for name, array in leaves(state):
            if array.shape[: len(lead)] != lead:
                raise Broken(
                    f"after {verb}, {name} of the state has the shape {array.shape} for objects with leading axes "
                    f"{lead}; each object needs its own row"
                )
    _check_shapes(f.estimate(state), SIZES, lead, "estimate returns")
    _check_shapes(pair[1], AXES, lead, "the info of update has")


def there_may_be_no_object(f: Any) -> None:
    """A batch of no objects can be made, predicted and read: that is how a tracker begins."""
    state = f.predict(f.init(prior(np.zeros((0, 3)))), 0.1)
    for name, array in leaves(state):
        if array.shape[:1] != (0,):
            raise Broken(f"{name} of the state has the shape {array.shape} for no objects; it should begin with 0")
    _check_shapes(f.estimate(state), SIZES, (0,), "for no objects, estimate returns")


def init_then_estimate_returns_the_prior(f: Any) -> None:
    """The estimate of a state that was just made is its prior: pose, velocity along the heading, size."""
    start = prior((3.0, -2.0, 0.4), velocity=20 * unit(np.array(0.4)), size=(5.0, 2.0))
    got = f.estimate(f.init(start))
    law = "the estimate after init is not the prior"
    check_equal((got.pose, got.velocity), (start.pose, start.velocity), 1e-7, 1e-9, law)
    check_equal(got.size, start.size, 1e-6, 0, f"{law}, in its size")


def a_zero_time_step_changes_nothing(f: Any, seed: int = 0, rtol: float = 1e-9, atol: float = 1e-9) -> None:
    """`predict(state, 0)` returns the state: several scans may have one time."""
    state = f.init(random_prior(np.random.default_rng(seed), (3,)))
    check_equal(f.predict(state, 0.0), state, rtol, atol, "predict(state, 0) changes the state")


def a_prediction_moves_by_the_velocity(f: Any) -> None:
    """An object in straight motion is predicted at its place plus velocity times time, with no less uncertainty."""
    velocity, where = 12 * unit(np.array(0.4)), np.array([3.0, -2.0])
    state = f.init(prior((*where, 0.4), velocity=velocity, size=(5.0, 2.0), yaw_rate_std=1e-3, heading_std=1e-3))
    before, after = f.estimate(state), f.estimate(f.predict(state, 0.5))
    off = float(np.hypot(*(after.pose[:2] - where - 0.5 * velocity)))
    if not off < 0.1:
        raise Broken(f"after 0.5 s at 12 m/s the prediction is {off:.2f} m from where the velocity leads")
    if not (np.diag(after.cov)[:2] >= np.diag(before.cov)[:2] * (1 - 1e-9)).all():
        raise Broken("the position is better known after predict than before; P grows by the process noise")


def without_a_detection_the_prediction_stands(
    f: Any, seed: int = 3, missing: bool = False, rtol: float = 0.0, atol: float = 0.0
) -> None:
    """An update with an empty mask, or without any column, returns the state, and the rows that have no detection."""
    rng = np.random.default_rng(seed)
    state = f.predict(f.init(random_prior(rng, (4,))), 0.1)
    scan = random_scan(rng, f.estimate(state).pose, lead=(4,), missing=missing)
    empty = f.update(state, scan._replace(mask=np.zeros((4, 7), bool)))[0]
    law = "an update without a detection changes the state"
    check_equal(empty, state, rtol, atol, law)
    none = Scan(np.zeros((4, 0, 3)), np.zeros((4, 0), bool), np.zeros((1, 3)), np.zeros((1, 2)))
    check_equal(f.update(state, none)[0], state, rtol, atol, f"{law}, where the scan has no columns")
    some, rows = scan.mask.copy(), np.array([1, 2])
    some[rows] = False
    new = f.update(state, scan._replace(mask=some))[0]
    law = "an update changes objects that have no detection, because others of the batch have some"
    check_equal(take(new, rows), take(state, rows), rtol, atol, law)


def a_batch_equals_the_loop(
    f: Any,
    seed: int = 5,
    lead: Lead = (3, 2),
    missing: bool = False,
    rtol: float = 1e-9,
    atol: float = 1e-9,
) -> None:
    """Objects together have the states that each has alone."""
    rng = np.random.default_rng(seed)
    start = random_prior(rng, lead)
    scan = random_scan(rng, start.pose, lead=lead, missing=missing)
    state = f.update(f.predict(f.init(start), 0.1), scan)[0]
    i: Any
    for i in np.ndindex(*lead):
        one = f.predict(f.init(take(start, i)), 0.1)
        one = f.update(one, scan._replace(polar=scan.polar[i], mask=scan.mask[i]))[0]
        law = f"an object in a batch {lead} is not what it is alone"
        check_equal(take(state, i), one, rtol, atol, law)
        check_equal(f.estimate(take(state, i)), take(f.estimate(state), i), rtol, atol, f"{law}, in its estimate")


def order_and_padding_do_not_matter(
    f: Any, seed: int = 7, missing: bool = False, rtol: float = 1e-7, atol: float = 1e-9
) -> None:
    """Detections may come in any order, and what is not under the mask may hold anything, even NaN."""
    rng = np.random.default_rng(seed)
    start = f.init(random_prior(rng))
    scan = random_scan(rng, f.estimate(start).pose, missing=missing)
    state = f.update(start, scan)[0]
    order = rng.permutation(len(scan.mask))
    mixed = scan._replace(polar=scan.polar[order], mask=scan.mask[order])
    check_equal(f.update(start, mixed)[0], state, rtol, atol, "another order of the detections gives another state")
    polar = np.where(scan.mask[:, None], scan.polar, np.nan)
    law = "NaN where the mask is false changes the state; use np.where(mask, ..., 0), for 0 * NaN is NaN"
    check_equal(f.update(start, scan._replace(polar=polar))[0], state, law=law)


def turning_the_world_turns_the_answer(
    f: Any, seed: int = 9, turn: float = 2.0, missing: bool = False, rtol: float = 1e-6, atol: float = 1e-9
) -> None:
    """Object, detections and sensor turned about the origin by `turn` [rad] give the estimate, turned."""
    rng = np.random.default_rng(seed)
    start = random_prior(rng)
    scan = random_scan(rng, start.pose, missing=missing)
    M = rotation(turn)

    def turned(e: Estimate) -> Estimate:
        J = np.kron(np.eye(2), M)
        pose = np.concatenate([M @ e.pose[:2], e.pose[2:] + turn])
        contour = None if e.contour is None else e.contour @ M.T
        return e._replace(pose=pose, velocity=M @ e.velocity, cov=J @ e.cov @ J.T, contour=contour)

    sensor = np.concatenate([scan.pose[0, :2] @ M.T, scan.pose[0, 2:] + turn])
    plain = turned(f.estimate(f.update(f.predict(f.init(start), 0.2), scan)[0]))
    other = f.estimate(f.update(f.predict(f.init(turned(start)), 0.2), scan._replace(pose=sensor[None]))[0])
    law = f"with the world turned by {turn:.3g} rad the answer is not the answer turned"
    check_equal(wrap_angle(plain.pose[2] - other.pose[2]), np.array(0.0), 1e-7, 1e-6, f"{law}, in the heading")
    plain.pose[2] = other.pose[2]  # the same direction, perhaps a full turn apart
    check_equal(other, plain, rtol, atol, law)


def covariances_stay_symmetric_and_positive(
    f: Any,
    seed: int = 11,
    tiny: float = 1e-4,
    lead: Lead = (),
    steps: int = 5,
    missing: bool = False,
) -> Any:
    """The covariance of an estimate is exactly symmetric and positive definite, also from `tiny` times the usual prior.

    Sizes are positive and everything is finite. Returns the last state.
    """
    rng = np.random.default_rng(seed)
    start = random_prior(rng, lead)
    state = f.init(start._replace(cov=tiny * start.cov))
    for _ in range(steps):
        state = f.update(f.predict(state, 0.1), random_scan(rng, start.pose, lead=lead, missing=missing))[0]
    e = f.estimate(state)
    check_finite(e, f"after {steps} scans the estimate cannot be used")
    if not (e.cov == e.cov.mT).all():
        off = np.abs(e.cov - e.cov.mT).max()
        raise Broken(f"cov of the estimate is not symmetric, by {off:.2g}; let update return (P + P.mT) / 2")
    if not (least := np.linalg.eigvalsh(e.cov).min()) > 0:
        raise Broken(f"cov of the estimate is not positive definite, its least eigenvalue is {least:.3g}")
    if not (e.size > 0).all():
        raise Broken(f"the size must stay positive, it is {e.size.min():.3g} m")
    return state


def all_detections_at_one_point_leave_a_finite_state(f: Any) -> None:
    """500 detections without any spread, 20 times."""
    state = f.init(prior((0.0, 0.0, 0.0)))
    for _ in range(20):
        state = f.update(f.predict(state, 0.05), Scan.from_xy(np.full((500, 2), 0.3)))[0]
    check_finite(state, "after 20 scans of 500 detections at one point")


def missing_range_rates_do_no_harm(f: Any, seed: int = 13) -> None:
    """Range rates that were not measured are NaN; a state after a scan in which some, or all, are is finite."""
    rng = np.random.default_rng(seed)
    start = random_prior(rng, (4,))
    scan = random_scan(rng, start.pose, lead=(4,), missing=True)
    polar = scan.polar.copy()
    polar[2:, :, 2] = np.nan
    state = f.update(f.predict(f.init(start), 0.1), scan._replace(polar=polar))[0]
    law = "a range rate that was not measured is NaN, and spoils the state; leave such out"
    check_finite((state, f.estimate(state)), law)


def arguments_are_left_as_they_were(f: Any, seed: int = 15) -> None:
    """`predict` and `update` return a new state and leave the old one, and the scan, as they were."""
    rng = np.random.default_rng(seed)
    start = random_prior(rng, (2,))
    scan = random_scan(rng, start.pose, lead=(2,))
    state = f.init(start)
    for verb, work in (("predict", lambda s: f.predict(s, 0.1)), ("update", lambda s: f.update(s, scan)[0])):
        given = (state, scan)
        copies = [np.array(a) for a in arrays(given)]
        new = work(state)
        for (name, now), then in zip(leaves(given), copies, strict=True):
            law = f"{verb} writes into its argument, which others still use; work on a copy"
            check_equal(now, then, 0, 0, f"{law} ({name})")
        state = new


def a_filter_remembers_nothing(f: Any, seed: int = 17) -> None:
    """The same call gives the same result, whatever was called in between: states hold all that is known."""
    rng = np.random.default_rng(seed)
    first, second = (random_prior(rng, (2,)) for _ in range(2))
    scan, other = (random_scan(rng, p.pose, lead=(2,)) for p in (first, second))
    state = f.predict(f.init(first), 0.1)
    once = f.update(state, scan)[0]
    f.update(f.predict(f.init(second), 0.3), other)
    law = "the same call gave another result the second time; a filter keeps nothing between calls"
    check_equal(f.predict(f.init(first), 0.1), state, 0, 0, law)
    check_equal(f.update(state, scan)[0], once, 0, 0, law)


def detections_draw_the_estimate(f: Any, seed: int = 19) -> None:
    """An object seen from straight behind, 1 m beside its prior, is found within 0.5 m across in 15 scans."""
    rng = np.random.default_rng(seed)
    state = f.init(prior((20.0, 1.0, 0.0), size=(4.6, 1.86), velocity=(0.0, 0.0)))
    for _ in range(15):
        rear = np.stack([np.full(12, 20.0 - 2.3), rng.uniform(-0.93, 0.93, 12)], -1)
        state = f.update(f.predict(state, 0.1), Scan.from_xy(rear, noise=(0.1, 0.005, 0.1)))[0]
    off = abs(float(f.estimate(state).pose[1]))
    if not off < 0.5:
        raise Broken(f"an object 1 m beside its prior is still {off:.2f} m off after 15 scans of 12 detections")


def states_can_be_chosen_and_stacked(f: Any, seed: int = 21) -> None:
    """Rows of states of several objects can be taken, put together and chosen between: tracks come and go."""
    rng = np.random.default_rng(seed)
    a, b = (f.init(random_prior(rng)) for _ in range(2))
    both = stack([a, b])
    law = "a row of stacked states is not the state that was put there"
    check_equal(take(select(np.array([True, False]), both, both), np.array(1)), b, 0, 0, law)


def a_shift_moves_the_estimate_and_nothing_else(f: Any, seed: int = 2) -> None:
    """`shift(state, d)` adds d [m] to the centre and to the contour."""
    rng = np.random.default_rng(seed)
    start = random_prior(rng, (4,))
    state = f.update(f.predict(f.init(start), 0.1), random_scan(rng, start.pose, lead=(4,)))[0]
    d = rng.normal(0, 2, (4, 2))
    before, after = f.estimate(state), f.estimate(f.shift(state, d))
    pose = before.pose.copy()
    pose[:, :2] += d
    contour = None if before.contour is None else before.contour + d[:, None]
    law = "shift does not move the estimate by d, or changes more than its place"
    check_equal(after, before._replace(pose=pose, contour=contour), law=law)


def a_resize_changes_the_size_and_nothing_else(f: Any, seed: int = 1) -> None:
    """`resize(state, size, std)` gives the estimate that size and its spread, and leaves the pose."""
    state = f.init(random_prior(np.random.default_rng(seed), (3,)))
    size, std = np.full((3, 2), [9.0, 2.4]), np.full((3, 2), [0.9, 0.24])
    got = f.estimate(f.resize(state, size, std))
    check_equal((got.size, got.size_std), (size, std), 1e-9, 0, "resize does not give the size, or its spread")
    check_equal(got.pose, f.estimate(state).pose, law="resize moves the object")


def _check_shapes(record: Any, axes: dict[str, Lead], lead: Lead, what: str) -> None:
    for name, tail in axes.items():
        if not hasattr(record, name):
            raise Broken(f"{what} no {name}; it must have {', '.join(axes)}")
        if np.shape(getattr(record, name)) != (*lead, *tail):
            raise Broken(f"{what} {name} of shape {np.shape(getattr(record, name))}, which should be {(*lead, *tail)}")
