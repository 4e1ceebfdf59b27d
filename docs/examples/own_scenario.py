"""Your own scenario: a van ahead moves two lanes to the left while a truck hides a car on the right.

A scenario is a record with a builder: a function from a random generator to a world. Every draw comes from that
generator, so the seed of `reset` decides everything.

    python docs/examples/own_scenario.py
    testbed run own_scenario:scenario    (in this folder)
"""

import numpy as np

import testbed
from scenarios import Scenario
from scenarios.courses import Shift, follow_lane
from scenarios.highway import ScenarioEnv
from scenarios.longitudinal import AXIS, START, L, M, R  # a straight road: its axis, the ego's start, three lanes
from scenarios.networks import straight
from scenarios.stage import Flow, Stage, World, phases


def escape(rng: np.random.Generator) -> World:
    """The van starts 40 m ahead in the right lane and needs 6 s for two lanes."""
    stage = Stage(straight(), rng)
    speed, onset = rng.uniform(22.0, 26.0), rng.uniform(1.0, 2.0)
    stage.ego(M, START, speed)
    # A prescribed course: lane offsets are metres to the right of AXIS, which is the middle of the left lane.
    stage.prescribe("van", follow_lane(AXIS, START + 40.0, speed, shifts=(Shift(onset, 6.0, -8.0),), lateral=8.0))
    # Background traffic reacts: it follows the intelligent driver model.
    stage.fill(Flow(R, START + 15.0, speed, ("truck",)))
    stage.fill(Flow(R, START + 80.0, speed, ("car",)))
    stage.fill(Flow(L, START - 40.0, speed, ("car", "motorcycle")))
    return stage.world(phases(onset, onset + 6.0))


scenario = Scenario("escape", "A van crosses two lanes while a truck hides a car.", escape, vehicles=5, duration=9.0)


if __name__ == "__main__":
    env = testbed.TrackedEnv(ScenarioEnv(scenario))  # any highway-env environment can be wrapped like this
    env.reset(seed=0)
    for _ in range(45):  # 5 decisions a second
        env.step(testbed.PLANNERS["idm"].act(env))
    estimate = env.tracks.reported.estimate
    for kind, pose in zip(env.truth.objects.kind, env.truth.objects.pose):
        error = np.hypot(*(estimate.pose[:, :2] - pose[:2]).T)
        nearest = f"nearest track off by {error.min():.1f} m" if len(error) else "no track"
        print(f"{kind:10} at {pose[0]:6.1f}, {pose[1]:5.1f} m: {nearest}")
    env.close()
