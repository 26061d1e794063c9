"""Steps a second of many concurrent missions: ``SafeFlightVectorEnv`` compared with Gymnasium's ``AsyncVectorEnv``.

    python -m benchmarks.vector_environments [--missions 256] [--repetitions 5]

Both step the same missions of ``mathnavi/SafeFlight-v1`` on the same cores under the same random actions: ours in this
process, on one core, Gymnasium's in one process for each mission. Processes are forked after everything is imported,
compiled and built, so that they share memory; their start is excluded. Times are wall-clock times, measured in turns;
an action is held for a control step, 1/60 s, and for half a second. For 256 missions the processes need about 10 GB.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge

from benchmarks.arguments import read_arguments
from mathnavi.interfaces.bounds import Within, configuration

os.environ.setdefault("MUJOCO_GL", "disable")

import gymnasium
import numpy as np
from rich.console import Console

from benchmarks.comparison import Comparison, alone
from benchmarks.progress import progress
from mathnavi.interfaces.signals import Array

ENVIRONMENT = "mathnavi.sim.environments:mathnavi/SafeFlight-v1"
OTHER = "AsyncVectorEnv"
AT_LEAST = 10.0  # times as fast
HOLDS = {"1/60 s": 1.0 / 60.0, "1/2 s": 0.5}  # [s]
TARGET = {"jacksboro": (13320.0, 11610.0, 642.0)}  # [m], one for all missions


@configuration
class Arguments:
    """Measure how fast many concurrent missions are stepped."""

    terrain: str = "jacksboro"
    """name of a terrain, or an .npz file"""
    missions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 256
    """number of concurrent missions"""
    steps: Annotated[int, Within(Ge(1), allowed=">= 1")] = 10
    """number of steps of all missions in a repetition; ten times as many by ``SafeFlightVectorEnv``"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 5
    """number of runs of each environment"""
    out: Path = Path("renders/out/vector_environments.json")
    """file of the figures"""


@dataclass(frozen=True)
class VectorFindings:
    """Times (R,) [s] of a step of all missions, of ours and of Gymnasium's, by hold."""

    missions: int
    seconds: dict[str, tuple[Array, Array]]

    @property
    def title(self) -> str:
        return f"{self.missions} missions at once"

    def comparisons(self) -> list[Comparison]:
        wanted = AT_LEAST if self.missions == 256 else None
        return [
            Comparison(f"a step of all, held {hold}", "ms", 1e3 * ours, 1e3 * other, OTHER, "other / ours", wanted)
            for hold, (ours, other) in self.seconds.items()
        ]

    def show(self, console: Console) -> None:
        for hold, (ours, other) in self.seconds.items():
            rates = (f"{self.missions / float(np.median(seconds)):,.0f}" for seconds in (ours, other))
            console.print(f"held {hold}: {' and '.join(rates)} steps of a mission a second, ours and {OTHER}")

    def plain(self) -> dict[str, Any]:
        return {
            "missions": self.missions,
            "step_s": {hold: {"ours": a.tolist(), OTHER: b.tolist()} for hold, (a, b) in self.seconds.items()},
        }


def made(arguments: Arguments, mode: str, hold: float) -> Any:
    """Return the missions as one environment, stepped by ours ("vector_entry_point") or in a process each ("async")."""
    target = TARGET.get(arguments.terrain)
    fields: dict[str, Any] = {} if target is None else {"target": target, "drawn_separation": (0.15, 0.75)}
    if mode == "vector_entry_point":
        return gymnasium.make_vec(ENVIRONMENT, arguments.missions, mode, hold=hold, terrain=arguments.terrain, **fields)

    def one(seed: int) -> Any:
        return lambda: gymnasium.make(
            ENVIRONMENT, seed=seed, hold=hold, terrain=arguments.terrain, disable_env_checker=True, **fields
        )

    return gymnasium.vector.AsyncVectorEnv([one(seed) for seed in range(arguments.missions)])


def stepped(envs: Any, steps: int, rng: np.random.Generator) -> float:
    """Return the mean time [s] of a step of all missions."""
    low, high = envs.single_action_space.low, envs.single_action_space.high
    actions = rng.uniform(0.5 * low, 0.5 * high, (steps, envs.num_envs, len(low)))
    began = time.perf_counter()
    for each in actions:
        envs.step(each)
    return (time.perf_counter() - began) / steps


def run(arguments: Arguments, console: Console) -> VectorFindings:
    """Step the same missions by both environments in turns."""
    seconds = {}
    with progress(console, "stepping", len(HOLDS) * arguments.repetitions) as report:
        for k, (name, hold) in enumerate(HOLDS.items()):
            report(k * arguments.repetitions, f"making {arguments.missions} missions")
            ours = made(arguments, "vector_entry_point", hold)  # first, so that the processes find all built
            other = made(arguments, "async", hold)
            for envs in (ours, other):
                envs.reset(seed=0)
                stepped(envs, 2, np.random.default_rng(0))
            times = []
            for repetition in range(arguments.repetitions):
                report(k * arguments.repetitions + repetition, f"held {name}")
                rng, same = (np.random.default_rng(repetition) for _ in range(2))
                times.append((stepped(ours, 10 * arguments.steps, rng), stepped(other, arguments.steps, same)))
            other.close()
            ours.close()
            seconds[name] = (np.array(times)[:, 0], np.array(times)[:, 1])
    return VectorFindings(arguments.missions, seconds)


def main(arguments: Arguments) -> None:
    alone("vector_environments", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
