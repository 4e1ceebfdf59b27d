"""First steps: drive one scenario with a planner that sees tracks, never the truth.

python docs/examples/first_env.py
"""

import gymnasium as gym

import testbed  # registers the ids testbed/NAME-v0, one for every scenario

# Six radars ("surround") and the default tracker; gym.make also takes tracker="rm-feldmann", radar="imaging", ...
env = gym.make("testbed/cut-in-v0")
observation, info = env.reset(seed=0)  # the same seed gives the same traffic and the same detections
planner = testbed.PLANNERS["idm"]

for _ in range(15):  # 5 decisions a second: three seconds
    observation, reward, terminated, truncated, info = env.step(planner.act(env))
    if terminated or truncated:  # terminated: the ego crashed; truncated: the scenario is over
        break

print(f"after {env.truth.time:.1f} s: {info['detections']} detections, {info['tracks']} tracks")

# Between two calls the road holds the ego and one vehicle for each track. This is what a planner may read.
ego, *tracks = env.unwrapped.road.vehicles
for vehicle in tracks:
    ahead, right = vehicle.position - ego.position
    size = f"{vehicle.LENGTH:.1f} m long"
    print(f"track {ahead:6.1f} m ahead, {right:5.1f} m to the right, {vehicle.speed:4.1f} m/s, {size}")

# The truth is there for metrics and logs. `env.truth.objects` holds every vehicle but the ego.
print(f"{len(env.truth.objects.id)} vehicles in truth")
env.close()
