"""Learning to drive on tracks: DQN on highway-fast-v0, then the learned policy as a planner. Needs the extra `rl`.

python docs/examples/train.py [--tracker NAME] [--steps N] [--seed N] [--envs N] [--out FILE]
"""

from argparse import ArgumentParser
from functools import partial

import gymnasium as gym
import highway_env
import numpy as np
from stable_baselines3 import DQN
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

import testbed
from testbed.planners.learned import Learned, save_policy

gym.register_envs(highway_env)
RADAR = {"name": "surround", "rate": 5}  # [Hz]; the environment simulates 5 frames a second


def make_env(tracker: str) -> gym.Env:
    """Traffic, radar and tracker; a second of traffic passes before the first observation, so that there are tracks."""
    return testbed.TrackedEnv(gym.make("highway-fast-v0"), tracker=tracker, radar=RADAR, warm_up=1.0)


def train(tracker: str, steps: int, seed: int, envs: int) -> DQN:
    """The parameters with which highway-env's author trains on this environment."""
    kind = SubprocVecEnv if envs > 1 else DummyVecEnv
    env = make_vec_env(partial(make_env, tracker), n_envs=envs, seed=seed, vec_env_cls=kind)
    model = DQN(
        "MlpPolicy", env, policy_kwargs={"net_arch": [256, 256]}, learning_rate=5e-4, buffer_size=15_000,
        learning_starts=200, batch_size=32, gamma=0.8, train_freq=1, gradient_steps=-1, target_update_interval=50,
        seed=seed, device="cpu",
    )  # fmt: skip
    model.learn(steps)
    env.close()
    return model


def evaluate(planner: Learned, tracker: str, seeds: range) -> tuple[float, float, float]:
    """Mean length and return of the episodes, and the share that ends in a crash."""
    env, rows = make_env(tracker), []
    for seed in seeds:
        env.reset(seed=seed)
        rewards, done = [], False
        while not done:
            _, reward, crashed, over, _ = env.step(planner.act(env))
            rewards.append(float(reward))
            done = crashed or over
        rows.append((len(rewards), sum(rewards), crashed))
    env.close()
    length, total, crashes = np.mean(rows, 0)
    return length, total, crashes


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracker", default="imm-spline")
    for option, default in (("--steps", 20_000), ("--seed", 0), ("--envs", 1), ("--episodes", 50)):
        parser.add_argument(option, type=int, default=default)
    parser.add_argument("--out", default="policy.npz")
    given = parser.parse_args()
    q = train(given.tracker, given.steps, given.seed, given.envs).policy.q_net.q_net
    env = make_env(given.tracker)
    env.reset(seed=given.seed)
    save_policy(given.out, list(q), env)  # of PPO: [*policy.mlp_extractor.policy_net, policy.action_net]
    for tracker in ("truth", given.tracker):
        seeds = range(1000, 1000 + given.episodes)
        length, total, crashes = evaluate(Learned(given.out), tracker, seeds)
        print(f"on {tracker:12s} length {length:5.1f} return {total:5.1f} crashes {crashes:.0%}", flush=True)
