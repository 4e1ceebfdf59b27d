"""The papers' courses driven in traffic simulation and seen by our ray-cast radar, with ideal association.

The ego keeps its lane and speed; the rig on it scans every policy step, 5 Hz. y is to the driver's right here.
"""

import numpy as np
from numpy.typing import NDArray

from scenarios.adapter import SceneReader
from scenarios.highway import ScenarioEnv
from sensors.radar import Radar
from sensors.scene import Scene
from studies.papers.xia2020.methods import (
    LEARNED,
    LEARNED_N,
    MATCHED_PARTIAL,
    MM,
    ON_OTHER,
    ON_REAL,
    ON_RIG,
    ONLINE_N,
    OTHER_RIG,
    REAL,
    RIG,
    RM,
    RM_MATCHED,
    SEED,
)
from studies.papers.xia2020.trials import MEAN_SIZE, START_STD, NamedFilter, Trial, start
from trackers.geometry import unit
from trackers.htg.learned import HTGLearned, HTGMoment
from trackers.htg.map import HTGMap
from trackers.htg.online import HTGOnline
from trackers.random_matrix.feldmann import RandomMatrix
from trackers.scan import Scan

SCENARIOS = ("xia2020-lane", "xia2020-right-turn", "xia2020-s-curve", "hoher2022-u-turn")
IDLE = 1  # the meta-action


def episode(name: str, seed: int) -> list[Scene]:
    """Scenes of one ride after each policy step; raises RuntimeError for a crash, which no seed should have."""
    env = ScenarioEnv(name)
    env.reset(seed=seed)
    reader = SceneReader()
    scenes = [reader.read(env)]
    truncated = False
    while not truncated:
        _, _, terminated, truncated, _ = env.step(IDLE)
        if terminated:
            raise RuntimeError(f"{name}, seed {seed}: the ego crashed at {scenes[-1].time:.1f} s")
        scenes.append(reader.read(env))
    return scenes


def own_scans(scenes: list[Scene], radar: Radar, rng: np.random.Generator) -> list[Scan]:
    """Scans of the one object of the scenes, without false alarms and walls."""
    found = []
    for scene in scenes:
        scan, origin = radar.scan(scene, rng)
        own = origin.object == 0
        found.append(
            Scan(
                scan.polar[own], scan.mask[own], scan.pose[own], scan.velocity[own], scan.noise[own],
                scan.sensor[own], scan.platform,
            )
        )  # fmt: skip
    return found


def pad(scans: list[list[Scan]]) -> Scan:
    """Scans of R runs of T steps as one with leading axes (T, R) and a mask."""
    R, T = len(scans), len(scans[0])
    M = max(1, max(len(scan.mask) for run in scans for scan in run))

    def fill(name: str, *tail: int) -> NDArray:
        out = np.zeros((T, R, M, *tail))
        for r, run in enumerate(scans):
            for t, scan in enumerate(run):
                out[t, r, : len(scan.mask)] = getattr(scan, name)
        return out

    platform = np.array([[scans[r][t].platform for r in range(R)] for t in range(T)])
    return Scan(
        fill("polar", 3), fill("mask") > 0, fill("pose", 3), fill("velocity", 2), fill("noise", 3),
        fill("sensor").astype(int), platform,
    )  # fmt: skip


def radar_trial(scenario: str, radar: Radar, runs: int, seed: int) -> Trial:
    """Episodes with seeds seed, seed + 1, ...; the first kinematic state is the truth."""
    rides, scans = [], []
    for k in range(runs):
        rides.append(episode(scenario, seed + k))
        scans.append(own_scans(rides[-1][1:], radar, np.random.default_rng([seed + k, SEED])))
    objects = [[scene.objects for scene in ride] for ride in rides]
    pose = np.array([[o.pose[0] for o in ride] for ride in objects]).swapaxes(0, 1)
    velocity = np.array([[o.velocity[0] for o in ride] for ride in objects]).swapaxes(0, 1)
    size = np.array([ride[0].size[0] for ride in objects])
    yaw_rate = np.array([ride[0].yaw_rate[0] for ride in objects])
    x0 = np.column_stack([pose[0], (velocity[0] * unit(pose[0, :, 2])).sum(-1), yaw_rate])
    dt = rides[0][1].time - rides[0][0].time
    return Trial(
        f"{scenario}, {radar.name}", dt, round(2.0 / dt), pose[1:], velocity[1:], size, pad(scans),
        start(x0, MEAN_SIZE, START_STD),
    )  # fmt: skip


def radar_methods() -> tuple[NamedFilter, ...]:
    """Rows on our radar; the tables are the shipped ones, learned on the rig itself or on another radar."""
    slow = RandomMatrix(tau=10.0)
    held = f"{RIG}-car-cd25"
    return (
        NamedFilter(RM, lambda: slow),
        NamedFilter(RM_MATCHED, lambda: RandomMatrix(tau=10.0, rho=MATCHED_PARTIAL)),
        NamedFilter(ONLINE_N, lambda: HTGOnline(RandomMatrix(tau=10.0, rho=0.35))),
        NamedFilter(LEARNED, lambda: HTGLearned(held, slow)),
        NamedFilter(LEARNED_N, lambda: HTGLearned(held, slow, iterations=20, n_count=True)),
        NamedFilter(MM, lambda: HTGMoment(f"{RIG}-car", slow)),
        NamedFilter(ON_RIG, lambda: HTGMap(f"{RIG}-car"), size_std=0.1),
        NamedFilter(ON_OTHER, lambda: HTGMap(f"{OTHER_RIG}-car"), size_std=0.1),
        NamedFilter(ON_REAL, lambda: HTGMap(f"{REAL}-car"), size_std=0.1),
    )
