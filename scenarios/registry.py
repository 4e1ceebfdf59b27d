"""SCENARIOS: the catalogue of regression scenes, readable without loading the simulator.

The probes, short scenes that are just safe on the truth, are a table of their own, `scenarios.probes.PROBES`.
"""

from dataclasses import replace
from types import MappingProxyType
from typing import Any

from scenarios.probes import PROBES
from scenarios.record import TRAFFIC, Scenario
from scenarios.scenario_file import read_scenario
from scenarios.traffic.scenario import is_replay, replayed
from trackers.lookup import entry_of, is_own, look_up, parse
from trackers.toml_file import SUFFIX

SCENARIOS = MappingProxyType({s.name: s for s in (
    Scenario("following",
        "A leader in the ego's lane gently varies its speed; range, speed and length of one car must hold steadily.",
        "scenarios.longitudinal:following", 9),
    Scenario("hard-brake",
        "The leader brakes at 8 m/s^2; how late do estimated speed and planner react?",
        "scenarios.longitudinal:hard_brake", 9),
    Scenario("stop-and-go",
        "A jam: queues in three lanes stop and start in waves; heading and tracks must survive standstill.",
        "scenarios.longitudinal:stop_and_go", 14),
    Scenario("column",
        "Seventeen cars with gaps of 3 m at 25 m/s on both sides: none may be lost in a track over two of them.",
        "scenarios.longitudinal:column", 18),
    Scenario("slow-tractor",
        "A tractor with narrow bonnet and wide wheels at 8 m/s on a country road; fast approach, oncoming traffic.",
        "scenarios.longitudinal:slow_tractor", 7),
    Scenario("passed",
        "A car or a truck keeps its lane while it is passed: its motion across must stay none as its view turns.",
        "scenarios.maneuvers:passed", 1, duration=8.0, lateral=False),
    Scenario("onset",
        "A slow car ahead begins to turn off its lane: its heading must follow from the first tenths of a second.",
        "scenarios.maneuvers:onset", 1, duration=5.5, lateral=False),
    Scenario("cut-in",
        "A car from the left lane moves closely in front of the ego and is slower; its yaw must be seen early.",
        "scenarios.maneuvers:cut_in", 9),
    Scenario("cut-out",
        "The leader leaves the lane late and uncovers a slow van: first sight to confirmed track must be quick.",
        "scenarios.maneuvers:cut_out", 8),
    Scenario("truck-cut-in",
        "A rigid truck moves into the ego's lane; a long body turns and only its near side and rear are seen.",
        "scenarios.maneuvers:truck_cut_in", 9),
    Scenario("lane-change",
        "A car ahead changes lane within a long bend, so its turn has to be told from that of the road.",
        "scenarios.maneuvers:lane_change", 9),
    Scenario("double-lane-change",
        "A car on the right swerves towards the ego's lane and back: two reversals of yaw rate within seconds.",
        "scenarios.maneuvers:double_lane_change", 9),
    Scenario("overtake",
        "A fast car comes from behind, passes and moves in: one track from rear to front, through all aspects.",
        "scenarios.maneuvers:overtake", 8),
    Scenario("dense-traffic",
        "Thirty mixed vehicles close together, one changes lane; association and occlusion under load.",
        "scenarios.maneuvers:dense_traffic", 30),
    Scenario("truck-convoy",
        "Passing a convoy of trucks that hides cars beyond and between; one pulls out. Tracks must outlive occlusion.",
        "scenarios.maneuvers:truck_convoy", 10),
    Scenario("s-curve",
        "A motorway bends left, then right; a leader and its neighbours turn all the time, one changes lane.",
        "scenarios.maneuvers:s_curve", 8),
    Scenario("six-radar-highway",
        "The well-known public scene of six radars on a gentle left bend: truck on the right, fast car passing.",
        "scenarios.maneuvers:six_radar_highway", 4),
    Scenario("tunnel",
        "Two lanes between near walls, one car changes lane: with ghosts, traffic seems to drive behind the walls.",
        "scenarios.maneuvers:tunnel", 6),
    Scenario("beside-truck",
        "The ego passes a long truck while the leader swerves: with ghosts, the truck's side shows it a second time.",
        "scenarios.maneuvers:beside_truck", 6),
    Scenario("lone-leader",
        "Nobody but one leader between guard rails: with ghosts, rails and ego show it again on all sides.",
        "scenarios.maneuvers:lone_leader", 1),
    Scenario("merge",
        "A van joins from the ramp in front of the ego: a track born at the edge of the road crosses into the lane.",
        "scenarios.junctions:merge", 9),
    Scenario("exit",
        "A car ahead crosses to the exit lane, brakes and leaves: the track has to follow it off the road.",
        "scenarios.junctions:exit_ramp", 9),
    Scenario("oncoming",
        "Two-way road: oncoming vehicles at 40 m/s closing speed, one of them overtaking in the ego's lane.",
        "scenarios.junctions:oncoming", 8),
    Scenario("articulated-turn",
        "A truck with trailer brakes and turns right ahead: two bodies with a hinge, one object.",
        "scenarios.junctions:articulated_turn", 8),
    Scenario("roundabout",
        "The ego drives through a roundabout with vehicles circulating inside, waiting at the arms and leaving.",
        "scenarios.junctions:roundabout", 8),
    Scenario("u-turn",
        "A car ahead makes a U-turn, the ego follows: a turn through 180 degrees seen from a turning sensor.",
        "scenarios.junctions:u_turn", 6),
    Scenario("xia2020-lane",
        "The first course of Xia et al. (2020): one car follows on a nearly straight lane and shows its front only.",
        "scenarios.papers:xia_lane", 1),
    Scenario("xia2020-right-turn",
        "The second course of Xia et al. (2020): a car behind crosses from left to right in a tight right turn.",
        "scenarios.papers:xia_right_turn", 1),
    Scenario("xia2020-s-curve",
        "The third course of Xia et al. (2020): a car behind follows the ego through a tight S of two bends.",
        "scenarios.papers:xia_s_curve", 1),
    Scenario("hoher2022-u-turn",
        "The course of Hoher et al. (2022): a standing ego sees one car from all sides as it turns back and passes.",
        "scenarios.papers:hoher_u_turn", 1),
    Scenario("xu2023",
        "Table I of Xu et al. (2023), seen by who follows: accelerations across and along, and a quarter turn.",
        "scenarios.papers:xu_maneuvers", 1, max_lateral=5.5, duration=50.0),
    Scenario("yao2021-truck",
        "The course of Yao et al. (2021): a small truck on two half circles; its contour can be learned on the way.",
        "scenarios.papers:yao_truck", 1, duration=242.0, lateral=False),
    Scenario("yao2021-tractor",
        "The same course, driven by a tractor: narrow bonnet, wide wheels, seen from behind and from the side.",
        "scenarios.papers:yao_tractor", 1, duration=242.0, lateral=False),
)})  # fmt: skip


def find(name: str) -> Scenario:
    """The scenario or probe of that name: `NAME`, `NAME:parameter=value`, `MODULE:OBJECT:...`, `replay:FILE:...`.

    Or a file, `PATH.toml:...`. One with parameters, its own or those of `TRAFFIC`, has these as defaults, and the whole
    text as its name.

    Raises:
        LookupError: no such scenario; the nearest name is suggested.
        ValueError: a parameter or value that it cannot have, or an OBJECT that is no `Scenario`.
    """
    if is_replay(name):
        return replayed(name)
    catalogue = {**SCENARIOS, **PROBES}
    if not is_own(name, catalogue) and not (isinstance(name, str) and ":" in name):
        return look_up(name, catalogue, "scenario")
    entry, values = parse(name)
    found: Any = read_scenario(entry) if entry.endswith(SUFFIX) else entry_of(entry, catalogue, "scenario")
    if not isinstance(found, Scenario):
        raise ValueError(
            f"scenario {entry!r} is {found!r}; it must be a `scenarios.Scenario`, or, of an environment of "
            "highway-env, its class or a function of a config"
        )
    found = replace(found, name=name, drivers=str(values.pop("drivers", found.drivers)))
    found.population  # noqa: B018 - its errors
    own = {parameter.name: parameter for parameter in found.parameters}
    known = own | {parameter.name: parameter for parameter in TRAFFIC if parameter.name not in own}
    if unknown := values.keys() - known.keys():
        names = ", ".join((*known, "drivers"))
        raise ValueError(f"{entry} has no parameter {', '.join(sorted(unknown))}; it has {names}")
    kept = dict.fromkeys([*own, *values])
    parameters = tuple(replace(p, default=p.check(values.get(key, p.default))) for key in kept for p in [known[key]])
    return replace(found, parameters=parameters)
