import subprocess
import sys
from itertools import combinations, pairwise

import numpy as np
import pytest
from shapely.geometry import Polygon

from scenarios import PROBES, SCENARIOS, Scenario, find
from scenarios.bodies import parts
from scenarios.contours import CONTOURS
from trackers.geometry import box_corners

PROMISED = {  # new ones need not be named here
    "following", "hard-brake", "cut-in", "cut-out", "lane-change", "double-lane-change", "overtake", "merge", "exit",
    "dense-traffic", "truck-convoy", "truck-cut-in", "slow-tractor", "articulated-turn", "oncoming", "roundabout",
    "u-turn", "s-curve", "stop-and-go", "six-radar-highway", "xia2020-lane", "xia2020-right-turn", "xia2020-s-curve",
    "hoher2022-u-turn", "xu2023", "yao2021-truck", "yao2021-tractor",
}  # fmt: skip
EVERY = {**SCENARIOS, **PROBES}
every_scenario = pytest.mark.parametrize("scenario", EVERY.values(), ids=EVERY)


def snapshot(world):
    return [(*v.position, v.heading, v.speed, v.LENGTH, v.WIDTH) for v in world.road.vehicles]


def test_no_promised_scenario_is_missing_and_all_are_keyed_by_name():
    assert set(SCENARIOS) >= PROMISED
    assert all(SCENARIOS[name].name == name for name in SCENARIOS)


@every_scenario
def test_a_purpose_is_one_written_sentence(scenario):
    assert scenario.purpose.endswith((".", "?"))
    assert 40 < len(scenario.purpose) < 120


@every_scenario
def test_a_world_repeats_under_its_seed_and_has_the_vehicles_it_promises(scenario):
    first, again = (scenario.build(np.random.default_rng(3)) for _ in range(2))
    assert snapshot(first) == snapshot(again)
    assert first.phases == again.phases
    assert len(first.road.vehicles) == scenario.vehicles + 1
    assert sum(v is first.ego for v in first.road.vehicles) == 1


@every_scenario
def test_another_seed_gives_another_world_except_for_the_published_scene(scenario):
    first, other = (scenario.build(np.random.default_rng(seed)) for seed in (3, 4))
    assert (snapshot(first) == snapshot(other)) == (scenario.name == "six-radar-highway")


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(n, marks=pytest.mark.slow) for n in range(3, 16))])
@every_scenario
def test_no_two_vehicles_start_within_a_metre_of_each_other(scenario, seed):
    vehicles = scenario.build(np.random.default_rng(seed)).road.vehicles
    boxes = [[Polygon(box_corners(p.pose, p.size)) for p in parts(v)] for v in vehicles]
    nearest = min(p.distance(q) for a, b in combinations(boxes, 2) for p in a for q in b)
    assert nearest > 1.0  # [m] beside each other in lanes of 4 m


@every_scenario
def test_phases_cover_the_episode_without_gap_or_overlap(scenario):
    phases = scenario.build(np.random.default_rng(5)).phases
    assert phases[0].start == 0.0
    assert phases[-1].end >= scenario.duration
    assert all(a.end == b.start for a, b in pairwise(phases))
    assert all(p.start < p.end for p in phases)


@every_scenario
def test_the_maneuver_is_prescribed(scenario):
    world = scenario.build(np.random.default_rng(0))
    assert any(hasattr(v, "table") for v in world.road.vehicles)


def test_every_contour_of_a_road_user_appears_somewhere():
    worlds = [s.build(np.random.default_rng(0)) for s in SCENARIOS.values()]
    seen = {v.contour for w in worlds for v in w.road.vehicles} | {
        part.contour for w in worlds for v in w.road.vehicles if hasattr(v, "parts") for part in v.parts()
    }
    assert seen == set(CONTOURS) - {"box"}


def test_the_published_scene_starts_where_it_was_published():
    world = find("six-radar-highway").build(np.random.default_rng(0))
    # (x, y to the left, speed, length, width) as published; y is mirrored, and the road deviates from its chord by
    # up to 0.3 m between the published points
    published = [(50, 0, 25), (0, 1.8, 35), (86, -3.6, 25), (75, 0, 25), (30, 0, 25)]
    got = [(v.position[0], -v.position[1], np.linalg.norm(v.velocity)) for v in world.road.vehicles]
    np.testing.assert_allclose(got, published, atol=0.3)
    assert [(v.LENGTH, v.WIDTH) for v in world.road.vehicles[1:]] == [(4.7, 1.8), (8.1, 2.45), (4.7, 1.8), (4.7, 1.8)]


def test_a_course_beyond_the_limit_of_its_scenario_is_refused():
    tame = Scenario("tame", "A swerve that this record does not allow.", find("double-lane-change").builder, 9, 1.0)
    with pytest.raises(ValueError, match="drive slower or wider"):
        tame.build(np.random.default_rng(0))


def test_a_scenario_of_ones_own_needs_no_name_in_the_table():
    from scenarios.maneuvers import cut_in

    own = Scenario("mine", "The same cut-in, given as a function.", cut_in, 9)
    assert snapshot(own.build(np.random.default_rng(1))) == snapshot(find("cut-in").build(np.random.default_rng(1)))


def test_find_suggests_the_nearest_name():
    with pytest.raises(LookupError, match="did you mean 'cut-in'"):
        find("cut-inn")
    with pytest.raises(LookupError, match="known: following, hard-brake"):
        find("zzzz")


@pytest.mark.parametrize(
    ("change", "message"), [({"duration": 0.0}, "duration"), ({"builder": "cut_in"}, "module:func")]
)
def test_a_record_that_cannot_work_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Scenario(**({"name": "x", "purpose": "None.", "builder": "a:b", "vehicles": 1} | change))


def test_the_catalogue_can_be_read_without_loading_the_simulator():
    code = "import sys, scenarios; assert scenarios.SCENARIOS; sys.exit('highway_env' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_scenarios_under_one_seed_draw_their_own_numbers_and_a_parameter_changes_none():
    def first(name):
        return find(name).stream(np.random.default_rng(7)).random()

    assert len({first(name) for name in ("cut-in", "merge", "probe-brake")}) == 3
    assert first("probe-brake:gap=26") == first("probe-brake") == first("probe-brake:gap=20,drivers=calm")
    assert first("cut-in") != find("cut-in").stream(np.random.default_rng(8)).random()
