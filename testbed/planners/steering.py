"""Steering along a path, for vehicles whose actions are acceleration and steering angle.

The gains are those of `scenarios.vehicles.SoftSteering`, so that the ego turns alike under every action type.
"""

import numpy as np
from highway_env.vehicle.kinematics import Vehicle

from scenarios.vehicles import SoftSteering
from testbed.planners.prediction import LanePath
from trackers.geometry import cross, unit, wrap_angle

SLOWEST = 1.0  # [m/s] at lower speeds the gains of this one hold: a standing vehicle cannot turn
MOST = np.pi / 4  # [rad] of the angle towards the path


def offset_from(path: LanePath, ego: Vehicle) -> float:
    """Offset [m] of a vehicle across a path that begins beside it."""
    return float(cross(unit(path.heading[0]), ego.position - path.points[0]))


def steering_angle(path: LanePath, ego: Vehicle) -> float:
    """Angle of the front wheels [rad] that leads a kinematic bicycle back to a path that begins beside it."""
    speed, half = max(float(ego.speed), SLOWEST), ego.LENGTH / 2
    lead = speed * SoftSteering.TAU_HEADING - half  # [m] cancels the lag of the heading and the slip of the centre
    towards = np.arcsin(np.clip(-SoftSteering.KP_LATERAL * offset_from(path, ego) / speed, -1, 1))
    wanted = np.interp(max(lead, 0.0), path.arc, path.heading) + np.clip(towards, -MOST, MOST)
    turn = SoftSteering.KP_HEADING * float(wrap_angle(wanted - ego.heading))  # [rad/s]
    slip = np.arcsin(np.clip(turn * half / speed, -1, 1))
    return float(np.arctan(2 * np.tan(slip)))
