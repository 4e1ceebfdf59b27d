"""Your own planner: keep a time gap to the track ahead, in one function of the environment.

python docs/examples/own_planner.py
testbed run hard-brake --planner own_planner:act    (in this folder)
"""

from math import inf

import gymnasium as gym

import testbed  # noqa: F401  (registers the ids)

TIME_GAP = 1.5  # [s] to the rear of the vehicle ahead
CRUISE = 25.0  # [m/s]


def gap_ahead(env: gym.Env) -> float:
    """Free road [m] to the nearest track in the ego's lane, which runs along x in this scenario."""
    ego, *tracks = env.unwrapped.road.vehicles  # read nothing else: this road is made of tracks
    same_lane = [v for v in tracks if abs(v.position[1] - ego.position[1]) < 2.0 and v.position[0] > ego.position[0]]
    return min((v.position[0] - ego.position[0] - (v.LENGTH + ego.LENGTH) / 2 for v in same_lane), default=inf)


def act(env: gym.Env) -> int:
    """One of highway-env's five meta-actions: LANE_LEFT, IDLE, LANE_RIGHT, FASTER, SLOWER."""
    speed = env.unwrapped.vehicle.speed
    if gap_ahead(env) < TIME_GAP * speed:
        name = "SLOWER"
    else:
        name = "FASTER" if speed < CRUISE - 1.0 else "IDLE"
    return env.unwrapped.action_type.actions_indexes[name]


if __name__ == "__main__":
    env = gym.make("testbed/hard-brake-v0", config={"duration": 9.0})  # the leader brakes at 8 m/s^2
    env.reset(seed=10)
    done, step = False, 0
    while not done:
        if step % 5 == 0:
            print(f"{env.truth.time:4.1f} s  {env.unwrapped.vehicle.speed:4.1f} m/s  gap {gap_ahead(env):6.1f} m")
        _, _, crashed, over, _ = env.step(act(env))
        done, step = crashed or over, step + 1
    print("crashed" if crashed else "no collision")
    env.close()
