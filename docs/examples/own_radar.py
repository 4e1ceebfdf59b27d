"""Your own radar: two front radars with a finer and a coarser beam, beside the six-radar car of the catalogue.

python docs/examples/own_radar.py
testbed run cut-in --radar own_radar:double    (in this folder)
"""

from dataclasses import replace

import gymnasium as gym
import numpy as np

import testbed
from sensors import RADARS, Radar, Sensor

# A sensor is a row of figures; what is not given keeps its default, see sensors/radar.py.
long_range = Sensor(
    mount=(2.35, 0.0, np.radians(0.0)),  # x, y [m], heading in rad, from the vehicle's centre: the front bumper
    max_range=150.0,  # [m]
    fov_deg=18.0,
    spacing_deg=0.05,  # between rays
    sigma_range=0.2,  # [m]
    sigma_azimuth_deg=0.4,
    sigma_rate=0.1,  # [m/s]
    count_at_15m=10.0,  # expected detections of a car at 15 m
    clutter=2.0,  # expected false alarms a scan
)
short_range = replace(long_range, max_range=60.0, fov_deg=100.0, spacing_deg=0.25, sigma_azimuth_deg=1.5)
double = Radar("double", "a long and a short range radar ahead", (long_range, short_range), rate=15.0)


if __name__ == "__main__":
    for radar in (double, RADARS["surround"]):
        env = gym.make("testbed/truck-cut-in-v0", radar=radar)
        env.reset(seed=0)
        counts = []
        for _ in range(10):  # 5 decisions a second
            info = env.step(testbed.PLANNERS["idm"].act(env))[-1]
            counts.append((info["detections"], info["tracks"]))
        detections, tracks = np.mean(counts, 0)
        count = len(env.truth.objects.id)
        print(f"{radar.name}: {detections:.0f} detections a scan, {tracks:.1f} tracks of {count} vehicles")
        env.close()
