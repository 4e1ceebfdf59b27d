"""Ghosts where scenarios promise them: behind walls and rails, in the side of a truck, behind a leader."""

import gymnasium as gym
import numpy as np

import testbed  # noqa: F401  (registers the ids)
from sensors.origin import DOUBLE, MIRROR
from trackers.geometry import to_frame


def mirrored(scenario, seconds, seed=0):
    """The frames of a drive, and for each the ghosts (G, 2) [m] in the frame of the ego."""
    frames = []
    env = gym.make(f"testbed/{scenario}-v0", tracker="truth", radar="surround-ghosts", planner="truth")
    env.attach(frames.append)
    env.reset(seed=seed)
    while frames[-1].time < seconds:
        env.step(1)
    env.close()
    return frames, [to_frame(f.scene.ego.pose, f.scan.xy[f.origin.kind == MIRROR]) for f in frames]


def test_traffic_in_the_tunnel_is_seen_behind_both_walls():
    _, ghosts = mirrored("tunnel", 1.0)
    y = np.concatenate(ghosts)[:, 1]
    assert (y > 2.5).sum() > 5
    assert (y < -6.5).sum() > 5


def test_the_leader_who_swerves_beside_the_truck_is_seen_in_its_side():
    frames, ghosts = mirrored("beside-truck", 8.0, seed=2)
    shown = []
    for frame, xy in zip(frames, ghosts, strict=True):
        objects = frame.scene.objects
        truck, car = objects.kind.index("articulated"), objects.kind.index("car")
        side = objects.pose[truck, 1] - objects.size[truck, 1] / 2 - frame.scene.ego.pose[1]
        image = objects.pose[car, :2] - frame.scene.ego.pose[:2]
        image[1] = 2 * side - image[1]
        shown.append((np.hypot(*(xy - image).T) < 3.0).sum())
    assert sum(shown) > 20
    assert sum(shown[:15]) < sum(shown) / 4  # most of them during the swerve


def test_a_lone_leader_is_seen_in_both_rails_and_behind_itself():
    frames, ghosts = mirrored("lone-leader", 2.0)
    near = {"left": 0, "right": 0, "behind": 0}
    for frame, xy in zip(frames, ghosts, strict=True):
        ego = frame.scene.ego.pose
        leader = to_frame(ego, frame.scene.objects.pose[:, :2])[0]
        rails = to_frame(ego, frame.scene.walls.reshape(-1, 2))[:, 1]
        twice = to_frame(ego, frame.scan.xy[frame.origin.kind == DOUBLE])
        for where, rail in (("left", rails.min()), ("right", rails.max())):
            image = np.array([leader[0], 2 * rail - leader[1]])
            near[where] += int((np.hypot(*(xy - image).T) < 3.0).sum())
        near["behind"] += int((np.hypot(*(twice - [2 * leader[0] - 5.0, leader[1]]).T) < 4.0).sum())
    assert min(near.values()) > 5, near
    assert len(frames[0].scene.objects.id) == 1
