"""Train a stock PPO to fly a point mass across real mountains to its target, touching nothing.

    pip install 'mathnavi[learn]'        # a CPU build of PyTorch is enough
    python examples/learn/train_safe_flight.py --minutes 60 --out out/learn

``mathnavi/SafeFlight-v1`` steps 256 missions at once, from starts all over the map to one target. ``mathnavi.learning``
shows the policy features of order 1, with the target ahead, lets it choose a velocity, and makes of all missions a
``VecEnv``. PPO is Stable-Baselines3's, with its own network and losses.

Every few minutes the policy flies missions that it was not trained on. The folder gets ``curve.csv`` and ``curve.png``
(shares of arrivals and contacts over time), ``policy.zip``, ``evaluation.json`` and ``flight.mp4``.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from mathnavi.learning.flights import VelocityFlight, VelocityFlights
from mathnavi.learning.stable_baselines import StableBaselinesEnv
from mathnavi.learning.velocity import VelocityControl, features

ENVIRONMENT = "mathnavi.sim.environments:mathnavi/SafeFlight-v1"
TERRAIN, TARGET = "jacksboro", (13320.0, 11610.0, 642.0)  # [m] in a valley, 370 m below the hills around it
SEPARATION = (0.15, 0.75)  # shares of the map's side between which the start is away from there
TRAINED, TESTED = 0, 100_000  # first seeds of the missions flown in training, and of those to test
DISCOUNT = 0.995
CONTROL = VelocityControl()
OUTCOMES = ("arrived", "crashed", "off the map", "late")


def made(count: int, seed: int, missions: int) -> Any:
    """Return a vector environment of ``count`` concurrent missions, ``missions`` different ones from ``seed`` on."""
    return gymnasium.make_vec(
        ENVIRONMENT, num_envs=count, vectorization_mode="vector_entry_point", seed=seed, missions=missions,
        terrain=TERRAIN, target=TARGET, drawn_separation=SEPARATION, discount=DISCOUNT,
    )  # fmt: skip


def straight(observation: dict[str, np.ndarray]) -> np.ndarray:
    """Return actions (n, 3) straight to the target at 150 m/s, regardless of obstacles: the baseline of a policy."""
    offset = observation["target"]
    return CONTROL.actions(150.0 * offset / np.linalg.norm(offset, axis=1, keepdims=True), observation)


def evaluated(act: Callable[[dict[str, np.ndarray]], np.ndarray], envs: Any) -> dict[str, float]:
    """Shares of outcomes of one episode in every row, flown without exploration; clearance is that at every action."""
    observation, _ = envs.reset(seed=TESTED)
    outcomes, lowest = np.full(envs.num_envs, "", dtype=object), np.full(envs.num_envs, np.inf)
    fastest = np.zeros(envs.num_envs)
    while (outcomes == "").any():
        flying = outcomes == ""
        observation, _, ended, _, info = envs.step(CONTROL.accelerations(act(observation), observation))
        seen = np.where(ended, info["final_info"]["clearance"], info["clearance"]) if ended.any() else info["clearance"]
        lowest = np.where(flying, np.fmin(lowest, seen), lowest)
        speed = np.linalg.norm(observation["velocity"], axis=1)
        fastest = np.where(flying & ~ended, np.maximum(fastest, speed), fastest)
        first = flying & ended
        outcomes[first] = info["final_info"]["outcome"][first] if first.any() else ""
    shares = {outcome: float((outcomes == outcome).mean()) for outcome in OUTCOMES}
    arrived = outcomes == "arrived"
    return {
        **shares,
        "missions": float(envs.num_envs),
        "arrived_clear_of_h_min": float((arrived & (lowest >= 50.0)).mean()),
        "speed_max_m_s": float(fastest.max()),
    }


def acting(policy: PPO) -> Callable[[dict[str, np.ndarray]], np.ndarray]:
    """The mean actions of a policy."""
    return lambda observation: policy.predict(features(observation), deterministic=True)[0]


class Watch(BaseCallback):
    """Evaluates every ``every`` [s] and stops after ``seconds``; one row of the curve each."""

    def __init__(self, tests: Any, seconds: float, every: float) -> None:
        super().__init__()
        self.rows: list[dict[str, float]] = []
        self.outcomes: list[str] = []
        self._tests, self._seconds, self._every = tests, seconds, every
        self._began, self._due = time.perf_counter(), 0.0

    def _on_step(self) -> bool:  # the method that Stable-Baselines3 tells its users to override
        self.outcomes += [str(info["outcome"]) for info in self.locals["infos"] if "episode" in info]
        return time.perf_counter() - self._began < self._seconds

    def _on_rollout_end(self) -> None:  # the method that Stable-Baselines3 tells its users to override
        spent = time.perf_counter() - self._began
        if spent < self._due:
            return
        self._due = spent + self._every
        last = np.array(self.outcomes[-500:], dtype=object)
        recent = {f"training_{name}": float((last == name).mean()) if len(last) else 0.0 for name in OUTCOMES}
        row = {"minutes": spent / 60.0, "cpu_minutes": time.process_time() / 60.0, "steps": float(self.num_timesteps)}
        self.rows.append({**row, **evaluated(acting(self.model), self._tests), **recent})
        print({name: round(value, 3) for name, value in self.rows[-1].items()}, flush=True)


def write_curve(rows: list[dict[str, float]], folder: Path) -> None:
    """Write curve.csv and curve.png."""
    import matplotlib.pyplot as plt

    with (folder / "curve.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for name in OUTCOMES:
        axes.plot([row["minutes"] for row in rows], [100.0 * row[name] for row in rows], label=name)
    axes.set_xlabel("training [min]")
    axes.set_ylabel("missions not trained on [%]")
    axes.set_ylim(-2.0, 102.0)
    axes.legend()
    figure.savefig(folder / "curve.png", dpi=150)


def write_video(policy: PPO, path: Path, seed: int) -> None:
    """Film a mission that was not trained on."""
    import av

    env = VelocityFlight(
        gymnasium.make(
            ENVIRONMENT, seed=seed, terrain=TERRAIN, target=TARGET, drawn_separation=SEPARATION, discount=DISCOUNT,
            render_mode="rgb_array",
        ),
        CONTROL,
    )  # fmt: skip
    observation, _ = env.reset(seed=seed)
    with av.open(str(path), "w") as file:
        stream = file.add_stream("h264", rate=12)
        stream.width, stream.height, stream.pix_fmt = 640, 480, "yuv420p"
        over = False
        while not over:
            observation, _, over, _, _ = env.step(policy.predict(observation, deterministic=True)[0])
            file.mux(stream.encode(av.VideoFrame.from_ndarray(env.render(), format="rgb24")))
        file.mux(stream.encode())
    env.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0, help="of training, wall clock")
    parser.add_argument("--every", type=float, default=3.0, help="minutes between two evaluations")
    parser.add_argument("--envs", type=int, default=256, help="missions at once")
    parser.add_argument("--tests", type=int, default=200, help="missions of the last evaluation")
    parser.add_argument("--threads", type=int, default=2, help="of PyTorch")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/learn"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(given.threads)

    began = time.perf_counter()
    training = StableBaselinesEnv(VelocityFlights(made(given.envs, TRAINED, given.envs), CONTROL))
    tests = made(given.tests, TESTED, given.tests)
    seconds = time.perf_counter() - began
    print(f"{given.envs} missions to train on and {given.tests} to test, made in {seconds:.0f} s", flush=True)
    policy = PPO(
        "MlpPolicy", training, n_steps=64, batch_size=4096, n_epochs=5, learning_rate=3e-4, gamma=DISCOUNT,
        gae_lambda=0.95, clip_range=0.2, seed=given.seed, device="cpu",
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -1.0},
    )  # fmt: skip
    watch = Watch(tests, 60.0 * given.minutes, 60.0 * given.every)
    policy.learn(10**12, callback=watch)
    policy.save(given.out / "policy.zip")
    write_curve(watch.rows, given.out)
    final = {
        **evaluated(acting(policy), tests),
        "minutes": given.minutes,
        "steps": float(policy.num_timesteps),
        "straight_to_the_target": evaluated(straight, tests),
    }
    (given.out / "evaluation.json").write_text(json.dumps(final, indent=2) + "\n")
    print(json.dumps(final, indent=2))
    write_video(policy, given.out / "flight.mp4", TESTED + 1)


if __name__ == "__main__":
    main()
