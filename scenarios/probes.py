"""PROBES: short scenes in which a planner on the truth is just safe, so that every error of tracking costs something.

How hard a probe is, is a parameter: `gym.make("testbed/probe-brake-v0", config={"gap": 26})`. The other vehicles are on
prescribed courses, so the same seed gives the same traffic whatever the ego does. docs/probes.md shows each of them.
"""

from types import MappingProxyType

from scenarios.record import Parameter, Scenario

PROBES = MappingProxyType({s.name: s for s in (
    Scenario("probe-brake",
        "A near leader brakes at 8 m/s^2 by 16 m/s: lag of its speed, and loss of its track under braking.",
        "scenarios.encounters:brake", 3, duration=10.0, lateral=False,
        parameters=(Parameter("gap", 30.0, 60.0, 6.0, "m", "between the bumpers before it brakes"),)),
    Scenario("probe-cutin",
        "A slower car moves in from the left just ahead: its yaw and its motion across must be seen early.",
        "scenarios.encounters:cut_in", 3, duration=10.0, lateral=False,
        parameters=(
            Parameter("gap", 8.0, 40.0, 0.5, "m", "between the bumpers when the car is on the lane line"),
            Parameter("slower", 6.0, 1.0, 12.0, "m/s", "by which the car is slower than the ego"),
        )),
    Scenario("probe-reveal",
        "A truck swerves out of the lane before a standing car that it had hidden: how fast is a track born?",
        "scenarios.encounters:reveal", 3, duration=10.0, lateral=False,
        parameters=(
            Parameter("distance", 70.0, 120.0, 30.0, "m", "to the standing car when the truck is half out of the lane"),
        )),
    Scenario("probe-ramp",
        "A truck merges off a ramp; the motorcycle that it had hidden stands there: is so little seen in time?",
        "scenarios.encounters:ramp", 3, duration=10.0, lateral=False,
        parameters=(
            Parameter("distance", 70.0, 120.0, 30.0, "m", "to the motorcycle when the truck is half out of the lane"),
        )),
    Scenario("probe-jam",
        "A van ahead brakes to a standstill, starts and brakes again: standstill, and bias of its rear edge.",
        "scenarios.encounters:jam", 4, duration=12.0, lateral=False,
        parameters=(Parameter("gap", 12.0, 30.0, 3.0, "m", "between the bumpers before the van brakes"),)),
    Scenario("probe-pullout",
        "A van at 6 m/s, hidden by a truck, pulls out before the ego: late birth, heading at low speed.",
        "scenarios.encounters:pull_out", 3, duration=10.0, lateral=False,
        parameters=(Parameter("gap", 24.0, 60.0, 5.0, "m", "to the van when it is on the lane line"),)),
    Scenario("probe-passing",
        "Two trucks weave a little while the ego passes them, and no more: braking here is for nothing.",
        "scenarios.encounters:passing", 3, duration=10.0, calm=True,
        parameters=(Parameter("weave", 0.5, 0.0, 1.0, "m", "by which the trucks come towards the lane of the ego"),)),
    Scenario("probe-merge",
        "On a ramp that ends, beside a gap between a truck and a car: is it seen where both of them end?",
        "scenarios.encounters:merge", 4, duration=12.0,
        parameters=(Parameter("gap", 24.0, 60.0, 12.0, "m", "between the truck and the car"),)),
    Scenario("probe-oncoming",
        "An oncoming car overtakes in the ego's lane and is late: high closing speed, motion across far away.",
        "scenarios.encounters:oncoming", 3, duration=10.0, lateral=False,
        parameters=(
            Parameter("room", -5.0, 200.0, -30.0, "m", "left between the bumpers at the lane line if the ego kept on"),
        )),
)})  # fmt: skip
