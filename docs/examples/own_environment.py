"""Your own environment on the base of highway-env: two lanes, and a bus among the cars.

Vehicles are what their size says: a truck from 6 m on, a motorcycle below 1.2 m of width, else a car, or what their
`contour` names.

python docs/examples/own_environment.py
testbed run own_environment:Narrow:lanes_count=3 --tracker rm-koch --duration 2    (in this folder)
"""

from typing import Any

from highway_env.envs.highway_env import HighwayEnv
from highway_env.vehicle.behavior import IDMVehicle

import testbed


class Bus(IDMVehicle):
    LENGTH, WIDTH = 11.0, 2.5  # [m]
    contour = "bus"


class Narrow(HighwayEnv):
    @classmethod
    def default_config(cls) -> dict[str, Any]:
        return {**super().default_config(), "lanes_count": 2, "vehicles_count": 8, "duration": 20}

    def _create_vehicles(self) -> None:
        super()._create_vehicles()
        self.road.vehicles.append(Bus.create_random(self.road, spacing=2))


if __name__ == "__main__":
    env = testbed.TrackedEnv(Narrow(), tracker="rm-koch")
    env.reset(seed=0)
    for _ in range(5):
        env.step(testbed.PLANNERS["idm"].act(env))
    print(f"{', '.join(sorted(env.truth.objects.kind))}: {len(env.tracks.reported.id)} tracks")
    env.close()
