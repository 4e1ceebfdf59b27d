"""Populations of drivers: traits are drawn as stated, traffic without a population is as ever, and nobody collides."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from scenarios import find
from scenarios.courses import Segment, follow_lane
from scenarios.drivers import DEFAULT, POPULATIONS, Driver, Population, Unrest
from scenarios.drivers import find as find_population
from scenarios.longitudinal import AXIS
from scenarios.networks import straight
from scenarios.stage import Flow, Stage, traffic
from scenarios.vehicles import SizedIDM

COMMITTED = Path(__file__).parents[2] / "docs/results/drivers.json"
RECORDED = POPULATIONS["recorded"]
SUMS = [11756.261377187748, 128.0, 0.0, 603.6616707627559, 181.1809272664607]  # as it was before there were any


def build(name, seed=0):
    return find(name).build(np.random.default_rng(seed)).road


def states(road):
    return np.array([(*v.position, v.heading, v.speed, v.LENGTH) for v in road.vehicles])


def driven(road, seconds):
    for _ in range(round(seconds * 15)):
        road.act()
        road.step(1 / 15)
    return road


def test_traits_have_their_medians_spreads_and_correlation():
    population = Population(time_gap=(1.4, 0.5), unrest=(1.0, 0.4), speed=(1.2, 0.2), speed_unrest=0.6)
    rng = np.random.default_rng(0)
    drawn = np.log([[d.speed, d.time_gap, d.unrest] for d in (population.draw(rng) for _ in range(3000))])
    np.testing.assert_allclose(np.exp(np.median(drawn, 0)), (1.2, 1.4, 1.0), rtol=0.03)
    np.testing.assert_allclose(drawn.std(0), 0.9 * np.array([0.2, 0.5, 0.4]), rtol=0.1)  # cut at two spreads
    R = np.corrcoef(drawn.T)
    assert R[0, 2] == pytest.approx(0.6, abs=0.05)
    assert abs(R[0, 1]) < 0.05
    assert np.ptp(drawn[:, 1]) <= 4 * 0.5 + 1e-9


def test_an_unrest_has_its_strength_and_is_a_function_of_time():
    driver = RECORDED.draw(np.random.default_rng(1))
    unrest: Unrest = driver.habits(np.random.default_rng(2))["UNREST"]
    values = np.array([unrest.at(t) for t in np.arange(0, 2000, 0.5)])
    assert np.sqrt((values**2).mean()) == pytest.approx(driver.unrest, rel=0.15)
    assert unrest.at(3.7) == unrest.at(3.7)


def test_without_a_population_traffic_is_what_it_was():
    road = build("dense-traffic:drivers=default")
    np.testing.assert_array_equal(states(road), states(build("dense-traffic")))
    drivers = [v for v in road.vehicles if isinstance(v, SizedIDM)]
    assert {v.enable_lane_change for v in drivers} == {False}
    np.testing.assert_allclose(states(driven(road, 4.0)).sum(0), SUMS, rtol=0, atol=1e-6)


def test_a_population_leaves_sizes_courses_and_the_ego_as_they_are_and_repeats():
    plain, own = build("cut-in"), build("cut-in:drivers=recorded")
    np.testing.assert_array_equal(states(plain)[:, 4], states(own)[:, 4])
    same = [k for k, v in enumerate(plain.vehicles) if not isinstance(v, SizedIDM)]
    np.testing.assert_array_equal(states(plain)[same], states(own)[same])
    gaps = {v.TIME_WANTED for v in own.vehicles if isinstance(v, SizedIDM)}
    assert len(gaps) == len(own.vehicles) - len(same)  # a driver each
    again = build("cut-in:drivers=recorded")
    np.testing.assert_array_equal(states(driven(own, 4.0)), states(driven(again, 4.0)))
    assert (states(own) != states(driven(build("cut-in:drivers=recorded", 1), 4.0))).any()


@pytest.mark.parametrize("name", POPULATIONS)
@pytest.mark.parametrize("seed", range(3))
def test_nobody_of_a_population_collides_behind_an_emergency_stop(name, seed):
    with traffic(population=POPULATIONS[name]):
        stage = Stage(straight(), np.random.default_rng(seed))
        for k in range(3):
            plan = (Segment(2.0 + k), Segment(2.5, -8.0))
            stage.prescribe("car", follow_lane(AXIS, 900.0, 25.0, plan, lateral=4.0 * k))
            placed = stage.fill(Flow(("a", "b", k), 870.0, 25.0, ("car", "truck", "van", "car", "articulated", "car")))
            assert np.ptp([v.TIME_WANTED for v in placed]) > 0.1
    driven(stage.road, 15.0)
    assert not [v for v in stage.road.vehicles if v.crashed]


def test_the_fitted_population_is_the_committed_one():
    held = json.loads(COMMITTED.read_text())["population"]
    assert {key: tuple(v) if isinstance(v, list) else v for key, v in held.items()} == asdict(RECORDED)


def test_drivers_of_a_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("time_gap = [0.9, 0.2]\npace = 2\n")
    assert find_population(str(path)) == Population(time_gap=(0.9, 0.2), pace=2)
    road = build(f"following:drivers={path}")
    assert all(v.TIME_WANTED < 1.4 for v in road.vehicles if isinstance(v, SizedIDM))
    assert find_population(DEFAULT) is None


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("time_gaps = [1, 2]", ValueError, "has no key time_gaps; it has speed"),
        ("time_gap = 1.5", ValueError, "time_gap must be a median and a spread"),
        ("time_gap = [", ValueError, "is no TOML"),
        ("speed_unrest = 1.5", ValueError, "are too large together"),
        (None, LookupError, "cannot be read"),
    ],
)
def test_files_that_are_no_population_are_refused_in_a_sentence(text, error, words, tmp_path):
    path = tmp_path / "mine.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(error, match=words):
        find(f"cut-in:drivers={path}")


def test_a_name_that_is_no_population_gets_a_suggestion():
    with pytest.raises(LookupError, match="did you mean 'recorded'"):
        find("cut-in:drivers=recoded")


def test_a_driver_keeps_no_longer_time_gap_than_its_place_allows():
    driver = Driver(1.2, 2.0, 3.0, 1.5, 0.0, 0.0, np.inf, 1.0, 1.2)
    assert driver.within(23.0, 20.0).time_gap == 1.0
    assert driver.within(np.inf, 20.0).time_gap == 2.0
    assert driver.target(20.0, driver.gap(20.0)) == pytest.approx(24.0)
