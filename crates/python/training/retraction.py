"""Teaches a small network to bring tissue to a goal: PPO of stable-baselines3, on the processor, five seeds.

    pip install 'viscera[gym]' 'viscera[fit]' stable-baselines3
    python crates/python/training/retraction.py [--steps 60000] [--seeds 5] [--out learning.svg]

Draws the mean return of 100 actions over what was tried, beside a hand that follows a script and one that does nothing.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
import viscera.gym
from matplotlib.figure import Figure
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

NAME = "viscera/TissueRetraction-v0"
WORLDS = 16


class Side(VecEnv):  # type: ignore[misc]
    """Worlds of viscera as stable-baselines3 takes them: observations in one row each."""

    def __init__(self, count: int, seed: int) -> None:
        """So many of them."""
        self.many: Any = gymnasium.make_vec(NAME, num_envs=count)
        one = gymnasium.spaces.flatten_space(self.many.single_observation_space)
        super().__init__(count, one, self.many.single_action_space)
        self.first_seed, self.actions = seed, np.zeros(0)

    def flat(self, observation: dict[str, Any]) -> Any:
        """In the order of the space's names."""
        names = self.many.single_observation_space.spaces
        return np.concatenate([observation[name] for name in names], axis=1, dtype=np.float32)

    def reset(self) -> Any:
        """Begins."""
        return self.flat(self.many.reset(seed=self.first_seed)[0])

    def step_async(self, actions: Any) -> None:
        """Keeps what is to be done."""
        self.actions = actions

    def step_wait(self) -> Any:
        """Does it."""
        observation, reward, ended, cut, info = self.many.step(self.actions)
        done = ended | cut
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if "final_obs" in info:
            last = self.flat(info["final_obs"])
            for number in np.flatnonzero(done):
                infos[number]["terminal_observation"] = last[number]
                infos[number]["TimeLimit.truncated"] = bool(cut[number])
        return self.flat(observation), reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Nothing is open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The same of all."""
        return [getattr(self.many, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Worlds have nothing to set."""

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Worlds have none."""
        return [None] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """They are bare."""
        return [False] * self.num_envs


def mean_return(policy: Any, worlds: int = 64, seed: int = 1000) -> float:
    """Of one episode in each of many worlds, which no training has seen; an end that comes early adds nothing more."""
    many: Any = gymnasium.make_vec(NAME, num_envs=worlds)
    observation, _ = many.reset(seed=seed)
    total, runs = np.zeros(worlds), np.ones(worlds, dtype=bool)
    for _ in range(100):
        observation, reward, ended, cut, _ = many.step(policy(observation))
        total += np.where(runs, reward, 0.0)
        runs &= ~(ended | cut)
    return float(total.mean())


def script(observation: dict[str, Any]) -> Any:
    """Leads the grip by what is missing to the goal."""
    missing = observation["goal"] - observation["end"]
    return np.clip(missing / (viscera.gym.FRAMES * 5e-4), -1, 1).astype(np.float32)


def nothing(observation: dict[str, Any]) -> Any:
    """Holds still."""
    return np.zeros_like(observation["goal"])


class Look(BaseCallback):  # type: ignore[misc]
    """Asks every so many steps how good the policy is."""

    def __init__(self, side: Side, normal: VecNormalize, every: int) -> None:
        """Of a training."""
        super().__init__()
        self.side, self.normal, self.every = side, normal, every
        self.points: list[tuple[int, float]] = []

    def _on_step(self) -> bool:
        if self.num_timesteps >= len(self.points) * self.every:
            self.points.append((self.num_timesteps, mean_return(self.policy)))
        return True

    def policy(self, observation: dict[str, Any]) -> Any:
        """Without chance."""
        flat = self.normal.normalize_obs(self.side.flat(observation))
        return self.model.predict(flat, deterministic=True)[0]


def train(seed: int, steps: int) -> list[tuple[int, float]]:
    """The curve of one seed: steps, mean return."""
    side = Side(WORLDS, seed=10_000 * (seed + 1))
    normal = VecNormalize(side, clip_obs=10.0, gamma=0.97)
    model = PPO(
        "MlpPolicy",
        normal,
        seed=seed,
        n_steps=128,
        batch_size=256,
        gamma=0.97,
        learning_rate=1e-3,
        policy_kwargs={"net_arch": [32, 32], "log_std_init": -0.5},
        device="cpu",
    )
    look = Look(side, normal, max(steps // 20, 1))
    model.learn(steps, callback=look)
    look.points.append((model.num_timesteps, mean_return(look.policy)))
    return look.points


def draw(curves: list[list[tuple[int, float]]], scripted: float, still: float, out: Path) -> None:
    """The curves of all seeds, their mean, and what they are measured by."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    tried = np.array([[steps for steps, _ in curve] for curve in curves]).mean(axis=0) / 1e3
    returns = np.array([[value for _, value in curve] for curve in curves])
    for number, one in enumerate(returns):
        axes.plot(tried, one, color="C0", alpha=0.3, label="a seed" if number == 0 else None)
    axes.plot(tried, returns.mean(axis=0), color="C0", linewidth=2, label=f"mean of {len(curves)}")
    axes.axhline(scripted, color="C2", label=f"script {scripted:.0f}")
    axes.axhline(
        (scripted + still) / 2, color="0.4", linestyle="--", label="half of the script's gain"
    )
    axes.axhline(still, color="C3", label=f"nothing {still:.0f}")
    axes.set(
        xlabel="actions tried, in thousands",
        ylabel="return of 100 actions",
        title="TissueRetraction-v0",
    )
    axes.legend(fontsize="small", loc="lower right")
    figure.savefig(out)


def main() -> None:
    """Trains all seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=60_000)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--out", type=Path, default=Path("learning.svg"))
    given = parser.parse_args()
    torch.set_num_threads(1)
    scripted, still = mean_return(script), mean_return(nothing)
    print(f"script {scripted:.1f}, nothing {still:.1f}")
    curves = []
    for seed in range(given.seeds):
        begun = time.perf_counter()
        curves.append(train(seed, given.steps))
        print(
            f"seed {seed}: {curves[-1][-1][1]:.1f} after {time.perf_counter() - begun:.0f} s",
            flush=True,
        )
    ends = [curve[-1][1] for curve in curves]
    print(f"mean {np.mean(ends):.1f}, half of the script's gain {(scripted + still) / 2:.1f}")
    draw(curves, scripted, still, given.out)


if __name__ == "__main__":
    main()
