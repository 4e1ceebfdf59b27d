"""Learning to drive on tracks, then the learned policy as a planner. Needs the extra `rl`; docs/learning-to-drive.md.

python docs/examples/train.py [--tracker NAME] [--first SOURCE] [--algorithm DQN|PPO] [--steps N] [--out FILE]
"""

from argparse import ArgumentParser
from functools import partial
from pathlib import Path

import gymnasium as gym
import highway_env
import numpy as np
import stable_baselines3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

import testbed
from testbed.environment.sources import conditions
from testbed.planners.learned import Learned, save_policy

gym.register_envs(highway_env)
RADAR = {"name": "surround", "rate": 5}  # [Hz]; the environment simulates 5 frames a second
FAST = "in-view+velocity_lag=0.25+loss_rate=0.1"  # what is in view with errors: no scans, no tracker
SHARE = 0.75  # of the steps on what comes first; the rest on the tracker
CHOSEN_BY, REPORTED = range(2000, 2010), range(1000, 1050)  # seeds of episodes; the trainings have others
COMMON = {"learning_rate": 5e-4, "gamma": 0.8, "device": "cpu", "policy_kwargs": {"net_arch": [256, 256]}}
OPTIONS = {  # with which highway-env's author trains on this environment
    "DQN": {"buffer_size": 15_000, "learning_starts": 200, "batch_size": 32, "gradient_steps": -1, "train_freq": 1,
            "target_update_interval": 50},
    "PPO": {"n_steps": 128, "batch_size": 64},
}  # fmt: skip


def make_env(source: str, algorithm: str, seed: int = 0) -> gym.Env:
    """Traffic and tracks, a second of it before the first observation: highway-env's for DQN, of tracks for PPO."""
    tracker = conditions.source(conditions.parse(source), RADAR, seed)
    env = testbed.TrackedEnv(gym.make("highway-fast-v0"), tracker=tracker, radar=RADAR, warm_up=1.0)
    return gym.wrappers.FlattenObservation(testbed.TrackObservation(env, scale=True)) if algorithm == "PPO" else env


def save(model: BaseAlgorithm, file: Path, algorithm: str) -> None:
    """The network of the policy, and the observation that it needs."""
    p, env = model.policy, make_env("truth", algorithm)
    env.reset(seed=0)
    layers = list(p.q_net.q_net) if algorithm == "DQN" else [*p.mlp_extractor.policy_net, p.action_net]
    save_policy(file, layers, env)


def evaluate(planner: Learned, source: str, seeds: range) -> tuple[float, float, float]:
    """Mean length and return of the episodes, and the share that ends in a crash."""
    env, rows = make_env(source, "DQN"), []  # the policy finds its own observation
    for seed in seeds:
        env.reset(seed=seed)
        rewards, done = [], False
        while not done:
            _, reward, crashed, over, _ = env.step(planner.act(env))
            rewards.append(float(reward))
            done = crashed or over
        rows.append((len(rewards), sum(rewards), crashed))
    length, total, crashes = np.mean(rows, 0)
    return length, total, crashes


class Best(BaseCallback):
    """Keeps the best policy of a training, by the return of episodes of its own seeds."""

    def __init__(self, file: Path, source: str, algorithm: str, every: int) -> None:
        super().__init__()
        self.file, self.source, self.algorithm, self.every, self.most = file, source, algorithm, every, -np.inf

    def _on_step(self) -> bool:
        if self.n_calls % self.every == 0:
            now = self.file.with_suffix(".now.npz")
            save(self.model, now, self.algorithm)
            _, total, crashes = evaluate(Learned(str(now)), self.source, CHOSEN_BY)
            print(f"{self.num_timesteps:7d} on {self.source}: return {total:5.1f} crashes {crashes:.0%}", flush=True)
            if total > self.most:
                self.most = total
                now.replace(self.file)
            now.unlink(missing_ok=True)
        return True


def train(phases: dict[str, int], file: Path, algorithm: str, seed: int, envs: int, checks: int) -> None:
    """Steps on one source after the other; what stays is the best policy of the last one."""
    kind, model = SubprocVecEnv if envs > 1 else DummyVecEnv, None
    for source, steps in phases.items():
        env = make_vec_env(partial(make_env, source, algorithm, seed), envs, seed, vec_env_cls=kind)
        if model is None:
            new = getattr(stable_baselines3, algorithm)
            model = new("MlpPolicy", env, seed=seed, **COMMON, **OPTIONS[algorithm])
        else:
            model.set_env(env)
        best = Best(file, source, algorithm, max(steps // envs // checks, 1))
        model.learn(steps, callback=best, reset_num_timesteps=False)
        env.close()


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracker", default="imm-spline")
    parser.add_argument("--first", default=FAST, help="what it learns on first; none: the tracker alone")
    parser.add_argument("--algorithm", choices=OPTIONS, default="DQN")
    for option, default in (("steps", 20_000), ("seed", 0), ("envs", 1), ("episodes", len(REPORTED)), ("checks", 5)):
        parser.add_argument(f"--{option}", type=int, default=default)
    parser.add_argument("--out", type=Path, default=Path("policy.npz"))
    given = parser.parse_args()
    first = round(SHARE * given.steps) * (given.first not in ("none", given.tracker) and given.tracker != "truth")
    phases = {given.first: first, given.tracker: given.steps - first}
    phases = {source: steps for source, steps in phases.items() if steps}
    train(phases, given.out, given.algorithm, given.seed, given.envs, given.checks)
    for source in ("truth", given.tracker):
        length, total, crashes = evaluate(Learned(str(given.out)), source, REPORTED[: given.episodes])
        print(f"on {source:12s} length {length:5.1f} return {total:5.1f} crashes {crashes:.0%}", flush=True)
