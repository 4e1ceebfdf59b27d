"""Contours learned in the loop: the rule, what it costs, what stays, and which class it is."""

from dataclasses import replace

import numpy as np
import pytest

from studies.papers.yao2021.simulation import CONTOURS, PRIOR, PRIOR_VAR, simulate
from testbed.check.draws import arrays
from testbed.evaluation.metrics import areas, region_iou
from trackers import Scan, find, prior
from trackers.batch import concatenate, take
from trackers.geometry import rotation, to_world, unit
from trackers.multi.tracker import events_of
from trackers.pmht import AdaptiveSpline, Learner, SplinePmht, Walk
from trackers.pmht.association import RelativeDetections
from trackers.pmht.classes import Catalogue
from trackers.pmht.learning import Refine, SplineContour, centres, is_simple
from trackers.pmht.model import curve
from trackers.pmht.model import find as find_model
from trackers.pmht.pool import added, empty
from trackers.pmht.visibility import visibility_table
from trackers.pmht.window import Decoupled, decouple, smoothed, thinned
from trackers.range_rate import RangeRates
from trackers.smoother import smooth_moments

DT = 1 / 15
SIZE = np.array([5.0, 2.0])
SPLINE = SplinePmht("surround-car+surround-truck", walk=Walk(0.4, 0.026, 1e-3))
QUICK = AdaptiveSpline(Learner(SPLINE, enough=30, turns=3), window=6, span=0.3, least=20)
CATALOGUE = Catalogue()
FULL = SplinePmht("yao2021", "none", rates=RangeRates(weight=0.0), sigma=0.05)


def drawn_scans(rng, count, cars=1, sensor=(-20.0, 6.0), size=SIZE, n=10):
    """Scans of the rear and the left of cars that drive ahead, side by side."""
    for k in range(count):
        x, y = 10.0 * DT * k, 8.0 * np.arange(cars)
        t, rear = rng.uniform(-0.5, 0.5, (cars, n)), rng.random((cars, n)) < 0.4
        body = np.stack([np.where(rear, -0.5, t), np.where(rear, t, 0.5)], -1) * size
        pose = np.stack([np.full(cars, x), y, np.zeros(cars)], -1)
        xy = to_world(pose, body) + 0.05 * rng.standard_normal(body.shape)
        where = np.stack([np.full(cars, x + sensor[0]), y + sensor[1], np.zeros(cars)], -1)[:, None]
        one = [Scan.from_xy(a, pose=b) for a, b in zip(xy, where, strict=True)]
        polar, mask = np.stack([scan.polar for scan in one]), np.stack([scan.mask for scan in one])
        yield one[0]._replace(polar=polar, mask=mask, pose=where)


def run(filter, rng, count, cars=1, each=None, **kw):
    y = 8.0 * np.arange(cars)
    pose = np.stack([np.zeros(cars), y, np.zeros(cars)], -1)
    state = filter.init(prior(pose, velocity=(10.0, 0.0), size=SIZE))
    notes = []
    for k, scan in enumerate(drawn_scans(rng, count, cars, **kw)):
        state = filter.predict(state, DT) if k else state
        state, info = filter.update(state, scan)
        notes += [(k, note) for note in info.notes]
        if each:
            each(k, state, info)
    return state, notes


def test_contours_change_by_the_rule_and_every_change_is_noted_with_both_contours():
    state, notes = run(QUICK, np.random.default_rng(0), 40)
    assert len(notes) >= 2
    first, note = notes[0]
    assert first >= 0.3 / DT
    assert {note.kind for _, note in notes} <= {"adapted", "classified"}
    assert "adapted" in [note.kind for _, note in notes]
    (event,) = events_of(note, np.array([7]))
    assert event.track == 7
    assert event.contours.shape == (2, 48, 2)
    assert np.abs(event.contours[1] - event.contours[0]).max() > 0.01
    assert np.abs(event.contours[1]).max() < 4.0
    assert np.isfinite(np.concatenate([leaf.ravel() for leaf in arrays(state)])).all()


def test_too_few_detections_change_nothing():
    state, notes = run(QUICK, np.random.default_rng(1), 30, n=1)
    offline = SPLINE.init(prior(np.zeros((1, 3)), size=SIZE))
    assert not [k for k, _ in notes if k < 20]
    short, none = run(AdaptiveSpline(Learner(SPLINE, enough=10**6, sure=1.0)), np.random.default_rng(1), 60)
    assert none == []
    np.testing.assert_array_equal(short.p, offline.p)
    assert state.m.shape == (1, 7)


def test_one_object_at_most_learns_in_a_look_and_all_of_them_in_the_end():
    busy, done = [], set()

    def each(k, state, info):
        busy.append(int((state.stage > 0).sum()))
        done.update(int(np.flatnonzero(note.where)[0]) for note in info.notes)
        assert len(info.notes) <= 1

    run(QUICK, np.random.default_rng(2), 60, cars=4, each=each)
    assert max(busy) == 1
    assert done == {0, 1, 2, 3}


def test_a_batch_learns_as_each_object_alone_where_all_may_learn_at_once():
    filter = AdaptiveSpline(Learner(SPLINE, enough=30, turns=3), window=6, span=0.3, least=20, at_once=3)
    together, notes = run(filter, np.random.default_rng(3), 16, cars=3)
    assert notes
    scans = list(drawn_scans(np.random.default_rng(3), 16, 3))
    start = prior(np.stack([np.zeros(3), 8.0 * np.arange(3), np.zeros(3)], -1), velocity=(10.0, 0.0), size=SIZE)
    for i in range(3):
        one = filter.init(take(start, i))
        for k, scan in enumerate(scans):
            one = filter.predict(one, DT) if k else one
            one, _ = filter.update(one, scan._replace(polar=scan.polar[i], mask=scan.mask[i], pose=scan.pose[i]))
        np.testing.assert_allclose(one.p, together.p[i], atol=1e-7)
        np.testing.assert_allclose(one.m, together.m[i], atol=1e-7)


def test_an_update_leaves_its_argument_as_it_was():
    scans = list(drawn_scans(np.random.default_rng(4), 30, 2))
    state = QUICK.init(prior(np.array([[0.0, 0, 0], [0, 8.0, 0]]), velocity=(10.0, 0.0), size=SIZE))
    for scan in scans:
        state = QUICK.predict(state, DT)
        copies = [np.array(leaf) for leaf in arrays(state)]
        new, _ = QUICK.update(state, scan)
        for leaf, copy in zip(arrays(state), copies, strict=True):
            np.testing.assert_array_equal(leaf, copy)
        state = new


def test_buffers_do_not_grow_and_rows_may_come_and_go():
    state, _ = run(QUICK, np.random.default_rng(5), 50, cars=2)
    fresh = QUICK.init(prior(np.zeros((1, 3))))
    assert [leaf.shape[1:] for leaf in arrays(state)] == [leaf.shape[1:] for leaf in arrays(fresh)]
    joined = concatenate([take(state, np.array([True, False])), fresh])
    assert joined.m.shape == (2, 7)
    assert joined.window.scans[1] == 0
    assert joined.pool.came[1].sum() == 0


def test_a_restart_keeps_the_contour_and_forgets_the_scans():
    state, notes = run(QUICK, np.random.default_rng(6), 30)
    again = QUICK.restart(state, QUICK.estimate(state)._replace(contour=None))
    assert notes
    np.testing.assert_array_equal(again.p, state.p)
    assert again.window.scans.sum() == again.pool.came.sum() == again.fresh.sum() == again.stage.sum() == 0
    longer = QUICK.resize(state, np.array([[9.0, 2.5]]), np.array([[0.5, 0.1]]))
    np.testing.assert_array_equal(longer.p[0], SPLINE.models[1].p)
    assert longer.pool.came.sum() == 0


def test_the_gains_of_the_window_smooth_as_the_smoother_does():
    filter = AdaptiveSpline(Learner(SPLINE), window=8, span=10.0)
    state, kept = filter.init(prior(np.zeros(3), velocity=(10.0, 0.0), size=SIZE)), []
    for k, scan in enumerate(drawn_scans(np.random.default_rng(7), 8)):
        scan = scan._replace(polar=scan.polar[0], mask=scan.mask[0], pose=scan.pose[0])
        before = filter.predict(state, DT) if k else state
        state, _ = filter.update(before, scan)
        kept.append((state.m, state.P, before.m, before.P, before.cross))
    assert filter.angles == (2,)
    want, _ = smooth_moments(*(np.stack(column) for column in zip(*kept, strict=True)))
    np.testing.assert_allclose(smoothed(state.window), want, atol=1e-9)


def one_sided(rng, count):
    """Decoupled detections of the rear and the left of a box that is shorter than the catalogue's."""
    rear, t = rng.random(count) < 0.5, rng.uniform(-0.5, 0.5, count)
    z = np.stack([np.where(rear, -0.47, t), np.where(rear, t, 0.42)], -1) + 0.02 * rng.standard_normal((count, 2))
    sensor = np.where(rear[:, None], [-20.0, 0.0], [0.0, 20.0])
    return Decoupled(z[None], np.tile([1e-4, 0, 1e-4], (1, count, 1)), sensor[None], np.ones((1, count), bool))


def learned(data, refine, rays=True):
    model = find_model("surround-car")
    off = SplineContour(model.p[None], model.Sigma[None])
    table = visibility_table(model.p, SIZE, 24)[None]
    log_pi = refine.log_weights(table, off.p, 24, SIZE[None], data.sensor) if rays else -np.log(24)
    now = off
    for _ in range(30):
        now = refine.run(now, off, data, log_pi, 0.1)
    return off, now


@pytest.mark.parametrize("seed", [0, 1])
def test_sides_that_no_ray_met_keep_their_place_and_the_others_go_where_the_detections_are(seed):
    data = one_sided(np.random.default_rng(seed), 300)
    off, now = learned(data, Refine(stiffness=0.5, symmetric=False))
    mu = centres(off.p, 24)[0]
    moved = np.linalg.norm(centres(now.p, 24)[0] - mu, axis=-1)
    unseen = (mu[:, 1] < -0.3) & (mu[:, 0] > -0.05)  # beyond the reach of control points of the rear
    assert unseen.sum() >= 3
    assert moved[unseen].max() < 0.02
    left = (mu[:, 1] > 0.3) & (np.abs(mu[:, 0]) < 0.25)
    assert centres(now.p, 24)[0][left, 1].mean() == pytest.approx(0.42, abs=0.02)
    soft = learned(data, Refine(stiffness=1e-6, symmetric=False), rays=False)[1]
    assert np.linalg.norm(centres(soft.p, 24)[0] - mu, axis=-1)[unseen].max() > 0.1


def test_the_other_side_is_the_mirror_image_and_a_contour_turns_one_way():
    _, now = learned(one_sided(np.random.default_rng(3), 300), Refine())
    mu = centres(now.p, 24)[0]
    np.testing.assert_allclose(mu[-np.arange(24) % 24] * [1.0, -1.0], mu, atol=5e-3)
    assert is_simple(now.p).all()
    assert not is_simple(now.p[:, ::-1]).any()  # clockwise


def test_the_known_noise_is_taken_out_of_the_spread():
    rng = np.random.default_rng(2)
    data = one_sided(rng, 300)
    noise = 0.08 * rng.standard_normal(data.z.shape)
    blurred = data._replace(z=data.z + noise, R=np.tile([0.08**2, 0, 0.08**2], (1, 300, 1)))
    blind = blurred._replace(R=np.tile([1e-6, 0, 1e-6], (1, 300, 1)))
    spread = [learned(d, Refine(prior=5.0))[1].Sigma[0, 6, 1, 1] for d in (blurred, blind)]
    assert spread[0] < 0.75 * spread[1]


def test_the_pool_keeps_the_newest_of_every_direction():
    def seen_from(angle, count, value):
        z = np.full((1, count, 2), value)
        sensor = np.tile(20 * unit(angle), (1, count, 1))
        return Decoupled(z, np.ones((1, count, 3)), sensor, np.ones((1, count), bool))

    pool, n = added(empty((1,), 8, 5), seen_from(np.pi, 4, 0.1))
    pool, _ = added(pool, seen_from(np.pi / 2, 3, 0.2))
    for _ in range(10):
        pool, _ = added(pool, seen_from(np.pi / 2, 3, 0.3))
    all_ = pool.all
    assert n == [4]
    assert all_.mask.sum() == 9
    assert sorted(all_.z[all_.mask][:, 0].round(1).tolist()) == [0.1] * 4 + [0.3] * 5
    assert added(pool, seen_from(0.0, 2, 3.0))[1] == [0]  # of something else


def test_with_all_sides_in_view_the_contour_comes_nearer_to_the_truth():
    """The truck of the experiment of yao2021, in steps of 1 s, adapted on the way."""
    filter = AdaptiveSpline(Learner(FULL, enough=200, sure=1.0), window=30, kept=24, span=20.0, at_once=3)
    runs = simulate(CONTOURS["tractor"], 3, np.random.default_rng(8))
    state = filter.init(prior(np.zeros((3, 3)), velocity=(11.2, 0.0), size=SIZE))
    P = np.tile(np.diag(PRIOR_VAR), (3, 1, 1))
    state = state._replace(m=np.tile(PRIOR, (3, 1)), P=P, cross=P)
    first = state.p
    for k in range(120):
        state = filter.predict(state, 1.0) if k else state
        state, _ = filter.update(state, runs.scan(k))
    truth = areas(np.tile(CONTOURS["tractor"], (3, 1, 1)))
    before, after = (region_iou(areas(curve(p) * SIZE), truth) for p in (first, state.p))
    assert after.mean() > before.mean() + 0.02


def detections_of(name, rng, angles, count, shift=(0.0, 0.0)):
    """Detections that a vehicle of the catalogue gives, its centre off by shift [m]: as `Catalogue.fit` takes them."""
    model = CATALOGUE.models[CATALOGUE.names.index(name)]
    size = np.array(model.size)
    table = visibility_table(model.p, size, 24)
    z, sensor = [], []
    for angle in angles:
        share = table[round(angle / (2 * np.pi) * 36) % 36]
        ellipse = rng.choice(24, count, p=share / share.sum())
        root = np.linalg.cholesky(model.Sigma[ellipse])
        z.append((model.mu[ellipse] + (root @ rng.standard_normal((count, 2, 1)))[..., 0]) * size + shift)
        sensor.append(np.tile(25 * unit(angle), (count, 1)))
    z, sensor = np.concatenate(z), np.concatenate(sensor)
    R = np.tile([[1e-4], [0.0], [1e-4]], (1, 1, len(z)))
    return RelativeDetections(z.T[None], R, np.ones((1, len(z)), bool)), sensor[None], size


@pytest.mark.parametrize("name", CATALOGUE.names)
def test_a_clear_case_is_of_its_class_and_its_place_and_size_are_found(name):
    seen, sensor, size = detections_of(name, np.random.default_rng(9), np.linspace(2.0, 3.1, 10), 8, (0.3, -0.1))
    fits = CATALOGUE.fit(seen, sensor, 0.95 * size[None], np.array([[[True, False], [False, True]]]))
    i = CATALOGUE.names.index(name)
    p = CATALOGUE.probability(fits.evidence)
    assert p.argmax() == i
    assert p[0, i] > 0.5  # a van and a car of its size are much alike
    assert p.sum() == pytest.approx(1.0)
    rear = fits.offset[0, i, 0] - fits.size[0, i, 0] / 2
    assert rear == pytest.approx(0.3 - size[0] / 2, abs=0.2)
    assert fits.size[0, i] == pytest.approx(size, rel=0.12)
    assert (fits.size_std > 0).all()


def test_what_was_hardly_seen_is_what_most_vehicles_are_and_not_for_sure():
    seen, sensor, size = detections_of("van", np.random.default_rng(10), [np.pi], 3)
    ends = np.array([[[True, False], [False, False]]])
    p = CATALOGUE.probability(CATALOGUE.fit(seen, sensor, np.array([[4.6, 1.9]]), ends).evidence)
    assert CATALOGUE.names[int(p.argmax())] == "car"
    assert p.max() < 0.9
    unknown = CATALOGUE.by_size(np.array([[5.1, 1.95]]), np.array([[2.0, 0.5]]))
    assert unknown.max() < 0.9


def test_objects_fit_in_a_batch_as_alone():
    rng = np.random.default_rng(11)
    cases = [detections_of(name, rng, [2.5, 2.8], 10) for name in ("car", "bus")]
    ends = np.array([[[True, False], [False, True]]])
    alone = [CATALOGUE.fit(seen, sensor, size[None], ends) for seen, sensor, size in cases]
    seen = RelativeDetections(*(np.concatenate(leaves) for leaves in zip(*(case[0] for case in cases), strict=True)))
    sensor, size = np.concatenate([case[1] for case in cases]), np.stack([case[2] for case in cases])
    together = CATALOGUE.fit(seen, sensor, size, np.tile(ends, (2, 1, 1)))
    for i, one in enumerate(alone):
        for a, b in zip(one, take(together, np.array([i])), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-9)


def test_a_sure_class_gives_size_and_contour_and_what_the_size_is_drawn_to():
    """A tractor that is tracked as a car, its rear where the track has it."""
    filter = find("pmht-spline-adaptive")
    catalogue, car = filter.learner.catalogue, np.array([4.6, 1.86])
    seen, sensor, size = detections_of("tractor", np.random.default_rng(12), np.linspace(2.0, 2.6, 20), 8, (0.2, 0.0))
    state = filter.init(prior(np.zeros((1, 3)), size=car))
    body = Decoupled(seen.z.mT / car, seen.R.mT / [car[0] ** 2, car.prod(), car[1] ** 2], sensor, seen.mask)
    pool, count = added(state.pool, body)
    assert count > 100
    assert np.isnan(filter.class_size(state)[0]).all()
    known = filter.learner.compared_with_classes(state._replace(pool=pool))
    which = catalogue.names.index("tractor")
    assert known.probability.argmax() == which
    assert known.kind == len(filter.spline.models) + which
    np.testing.assert_array_equal(known.p[0], catalogue.models[which].p)
    np.testing.assert_allclose(filter.class_size(known)[0], [size])
    np.testing.assert_allclose(known.m[0, 5:], size, rtol=0.1)
    assert known.m[0, 0] - known.m[0, 5] / 2 == pytest.approx(0.2 - size[0] / 2, abs=0.2)
    there = np.arange(pool.z.shape[2]) < pool.came[..., None]
    metres = known.pool.z * known.m[:, None, None, 5:] + known.m[:, None, None, :2]
    np.testing.assert_allclose(metres[there], (pool.z * car)[there], atol=1e-9)
    np.testing.assert_allclose((known.pool.sensor + known.m[:, None, None, :2])[there], pool.sensor[there], atol=1e-9)
    area = known.m[0, 5:].prod()
    np.testing.assert_allclose((known.pool.R[..., 1] * area)[there], (pool.R[..., 1] * car.prod())[there], atol=1e-12)
    np.testing.assert_allclose(
        (known.pool.R[..., 0] * known.m[0, 5] ** 2)[there], (pool.R[..., 0] * car[0] ** 2)[there], rtol=1e-9
    )
    longer = filter.restart(known, filter.estimate(known)._replace(size=np.array([[5.5, 2.5]])))
    assert longer.kind == known.kind
    other = filter.restart(known, filter.estimate(known)._replace(size=np.array([[9.0, 2.5]])))
    assert other.kind == 1
    assert np.isnan(filter.class_size(other)[0]).all()


def test_classes_have_names_and_probabilities():
    filter = find("pmht-spline-adaptive")
    estimate = filter.estimate(filter.init(prior(np.zeros((2, 3)))))
    assert filter.classes[0] == "car"
    assert estimate.class_probability.shape == (2, len(filter.classes))
    np.testing.assert_allclose(estimate.class_probability.sum(-1), 1.0)


@pytest.mark.parametrize("name", ["window", "at_once", "room"])
def test_bad_numbers_are_named(name):
    with pytest.raises(ValueError, match=name):
        AdaptiveSpline(Learner(SPLINE), **{name: 0})
    with pytest.raises(ValueError, match="turns"):
        Learner(SPLINE, turns=1)
    with pytest.raises(ValueError, match="shares"):
        Catalogue(shares=(0.5, 0.5))
    with pytest.raises(ValueError, match="stiffness"):
        Refine(stiffness=0.0)


def test_nothing_is_learned_from_a_part_of_an_object():
    scans = list(drawn_scans(np.random.default_rng(13), 40, 2))
    state = QUICK.init(prior(np.array([[0.0, 0, 0], [0, 8.0, 0]]), velocity=(10.0, 0.0), size=SIZE))
    for scan in scans:
        state = QUICK.learn_where(QUICK.predict(state, DT), np.array([True, False]))
        state, info = QUICK.update(state, scan)
        assert not any(note.where[1] for note in info.notes)
    assert state.pool.came.sum(-1).tolist() == [state.pool.came[0].sum(), 0]
    assert state.pool.came[0].sum() > 100
    np.testing.assert_array_equal(state.p[1], SPLINE.models[0].p)


def without(scan, k):
    """The scan without the detections of object k."""
    mask = scan.mask.copy()
    mask[k] = False
    return scan._replace(mask=mask)


def test_an_object_without_a_detection_stays_as_it_is_while_others_learn():
    state = QUICK.init(prior(np.array([[0.0, 0, 0], [0, 8.0, 0]]), velocity=(10.0, 0.0), size=SIZE))
    both = AdaptiveSpline(Learner(SPLINE, enough=30, turns=3), window=6, span=0.3, least=20, at_once=2)
    for k, scan in enumerate(drawn_scans(np.random.default_rng(15), 30, 2)):
        before = both.predict(state, DT)
        state, _ = both.update(before, without(scan, 1) if k >= 6 else scan)
        if k >= 6:
            for a, b in zip(arrays(take(before, np.array([1]))), arrays(take(state, np.array([1]))), strict=True):
                np.testing.assert_array_equal(a, b)


def test_what_is_compared_with_classes_does_not_depend_on_other_objects():
    rng, filter = np.random.default_rng(16), find("pmht-spline-adaptive")
    start = prior(np.zeros((2, 3)), size=(4.7, 1.9))
    sides = [detections_of("car", rng, angles, 10) for angles in ([np.pi, 3.0, 2.8], [0.0, 0.2, -0.2])]
    z = np.concatenate([seen.z.mT for seen, _, _ in sides]) / (4.7, 1.9)
    body = Decoupled(z, np.full((2, 30, 3), 1e-5), np.concatenate([s for _, s, _ in sides]), np.ones((2, 30), bool))
    state = filter.init(start)
    pool, _ = added(state.pool, body)
    together = filter.learner.compared_with_classes(state._replace(pool=pool))
    for i in range(2):
        one = take(state._replace(pool=pool), np.array([i]))
        np.testing.assert_allclose(
            filter.learner.compared_with_classes(one).probability[0], together.probability[i], atol=1e-9
        )


def test_turning_the_world_thins_out_the_same_detections():
    rng = np.random.default_rng(17)
    z, turn = rng.standard_normal((30, 2)), rotation(2.5)
    mask = np.ones(30, bool)
    a, b = (RelativeDetections(points.T, np.ones((3, 1)), mask) for points in (z, z @ turn.T))
    assert sorted(thinned(a, 16, np.array(0.3))) == sorted(thinned(b, 16, np.array(2.8)))


def test_a_class_that_is_not_sure_any_more_is_noted_as_such():
    filter = find("pmht-spline-adaptive")
    state = filter.init(prior(np.zeros((1, 3)), size=(2.2, 0.8)))
    known = filter.learner.of_kind(state, np.array([len(filter.spline.models) + filter.classes.index("motorcycle")]))
    seen, sensor, _ = detections_of("bus", np.random.default_rng(18), np.linspace(2.0, 2.6, 20), 8)
    pool, _ = added(known.pool, Decoupled(seen.z.mT / (20.0, 4.0), seen.R.mT / 100, sensor, seen.mask))
    long = known.m.copy()
    long[:, 5:] = 12.0, 2.5
    after = filter.learner.compared_with_classes(known._replace(m=long, pool=pool))
    assert after.kind[0] != known.kind[0]
    dropped = filter._reason("classified", known, after._replace(kind=np.array([0])))
    assert dropped.startswith("not sure any more")


def test_a_model_of_other_ellipses_and_a_missing_class_are_named():
    other = replace(find_model("surround-car"), spread=find_model("surround-car").spread[:12])
    with pytest.raises(ValueError, match="as many ellipses"):
        AdaptiveSpline(Learner(replace(SPLINE, model=other))).init(prior(np.zeros(3)))
    with pytest.raises(ValueError, match=r"no model lorry\.json"):
        _ = Catalogue(names=("lorry",), shares=(1.0,)).models
    with pytest.raises(ValueError, match="unseen"):
        Catalogue(unseen=2.0)
    with pytest.raises(ValueError, match="hysteresis"):
        AdaptiveSpline(Learner(SPLINE), hysteresis=-1.0)


def test_another_size_and_place_move_what_is_learned_from_along():
    """What a window and a pool say of the outline, in metres from the rear end, stays as it was."""
    state, _ = run(QUICK, np.random.default_rng(3), 9, cars=2)
    size, std = state.m[:, 5:] + [1.0, 0.2], np.full((2, 2), 0.1)
    d = (rotation(state.m[:, 2]) @ np.array([0.5, 0.0])[:, None])[..., 0]  # the rear stays
    other = QUICK.shift(QUICK.resize(state, size, std), d)

    def from_rear(state):
        for body in (decouple(state.window), state.pool.all):
            yield np.where(body.mask[..., None], (body.z + np.array([0.5, 0.0])) * state.m[:, None, 5:], 0.0)

    assert state.window.detections.min() >= 20
    assert state.pool.all.mask.any()
    for before, after in zip(from_rear(state), from_rear(other), strict=True):
        np.testing.assert_allclose(after, before, atol=0.02)  # sizes of the window differ a little
