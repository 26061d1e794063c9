"""Overhead of the closed loop over the physics in it: thread CPU time of a flight against that of its physics alone.

    python -m benchmarks.loop_overhead [--seconds 120] [--repetitions 11]

The parts are those of ``safe-flight``: the plant with its terrain and sensors, the estimator ``full_state``, the
tracker, the referee. Physics runs at 300 Hz; estimator, tracker and log at 60 Hz. The planner is idle: it returns one
certified plan to the target and is not called again. The commands of that flight are then replayed

* by ``mujoco.mj_step(model, data)`` in a Python loop on the same model,
* by dm_control's ``rl.control.Environment`` on it, which observes the state after every command and does no more.

All three make the same number of steps and end in the same state, which is checked.
"""

from __future__ import annotations

import dataclasses
import gc
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from annotated_types import Ge

from benchmarks.arguments import read_arguments
from mathnavi.interfaces.bounds import Within, configuration

os.environ.setdefault("MUJOCO_GL", "disable")

import mujoco
import numpy as np
from dm_control.mujoco import Physics
from dm_control.mujoco.wrapper import MjModel
from dm_control.rl.control import Environment
from rich.console import Console

from benchmarks.comparison import Comparison, Ratio, alone
from benchmarks.progress import progress
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import CONTROL_TICKS, TICK
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.scenarios.flight_fields import SafeFlightConfig
from mathnavi.sim.scenarios.safe_flight import VEHICLE, SafeFlight

NEVER = 36_000.0  # [s] until the planner is asked again
BARE, DM_CONTROL = "mujoco.mj_step", "dm_control"
AT_MOST = 1.25  # times the bare steps

Made = TypeVar("Made")


@configuration
class Arguments:
    """Compare the cost of the closed loop with that of its physics."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    seconds: float = 120.0
    """simulated time of a run [s]; less if the flight ends before"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 11
    """number of runs of each loop"""
    out: Path = Path("renders/out/loop_overhead.json")
    """file of the figures"""


class IdlePlanner:
    """Planner with one plan for the whole flight."""

    period = NEVER

    def __init__(self, answer: Plan) -> None:
        self._answer = answer

    def plan(self, request: PlanRequest) -> Plan:
        return self._answer


@dataclass(frozen=True, eq=False)
class Flight:
    """Record of a flight that the other loops repeat."""

    model: mujoco.MjModel
    start: Array  # (6,)
    end: Array  # (6,)
    commands: Array  # (n, 3) each held for ``CONTROL_TICKS``
    cpu: float  # [s] thread CPU time

    @property
    def seconds(self) -> float:
        """Simulated time [s]."""
        return len(self.commands) * CONTROL_TICKS * TICK


def fly(terrain: str, seconds: float) -> Flight:
    """Fly the closed loop of ``safe-flight`` with an idle planner."""
    closed_loop = SafeFlight.build(SafeFlightConfig(terrain=terrain), seed=1)
    plant, agent = closed_loop.plant, closed_loop.agents[VEHICLE]
    assert isinstance(plant, MujocoPlant)
    plan = agent.planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, plant.state(VEHICLE)), None))
    agent = dataclasses.replace(agent, planner=IdlePlanner(plan))

    def flown() -> Recording:
        return simulate(plant, {VEHICLE: agent}, seconds, closed_loop.finished)

    recording, cpu = timed(flown)
    truth = recording.truths[VEHICLE]
    return Flight(plant.model, truth[0], truth[-1], recording.agents[VEHICLE].commands[: len(truth) - 1], cpu)


def bare_steps(flight: Flight) -> float:
    """Return the thread CPU time [s] of MuJoCo's steps alone."""
    model, step = flight.model, mujoco.mj_step
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = flight.start[:3], flight.start[3:]
    mujoco.mj_forward(model, data)
    control = data.ctrl

    def stepped() -> None:
        for command in flight.commands:
            control[:] = command
            for _ in range(CONTROL_TICKS):
                step(model, data)

    _, cpu = timed(stepped)
    _check_end(BARE, np.concatenate((data.qpos, data.qvel)), flight)
    return cpu


class ReplayAgent:
    """Task of dm_control that observes the state, has no reward and never terminates."""

    def __init__(self, start: Array) -> None:
        self._start = start

    def initialize_episode(self, physics: Any) -> None:
        physics.data.qpos[:], physics.data.qvel[:] = self._start[:3], self._start[3:]

    def before_step(self, action: Array, physics: Any) -> None:
        physics.set_control(action)

    def after_step(self, physics: Any) -> None:
        pass

    def get_observation(self, physics: Any) -> dict[str, Array]:
        return {"position": physics.data.qpos.copy(), "velocity": physics.data.qvel.copy()}

    def get_reward(self, physics: Any) -> float:
        return 0.0

    def get_termination(self, physics: Any) -> None:
        return None


def dm_control_steps(flight: Flight) -> float:
    """Return the thread CPU time [s] of dm_control's environment."""
    physics = Physics.from_model(MjModel(flight.model))
    environment = Environment(physics, ReplayAgent(flight.start), n_sub_steps=CONTROL_TICKS)
    environment.reset()

    def stepped() -> None:
        for command in flight.commands:
            environment.step(command)

    _, cpu = timed(stepped)
    _check_end(DM_CONTROL, np.concatenate((physics.data.qpos, physics.data.qvel)), flight)
    return cpu


def timed(work: Callable[[], Made]) -> tuple[Made, float]:
    """Return the result of the work and its thread CPU time [s], after a garbage collection."""
    gc.collect()
    began = time.thread_time()
    made = work()
    return made, time.thread_time() - began


def _check_end(name: str, end: Array, flight: Flight) -> None:
    if not np.allclose(end, flight.end, rtol=1e-9, atol=1e-6):
        raise RuntimeError(f"{name} ends at {end.tolist()}, the flight at {flight.end.tolist()}: not the same work")


@dataclass(frozen=True, eq=False)
class LoopFindings:
    """Thread CPU time of each run of the three loops."""

    seconds: float  # [s] simulated in one run
    loop: Array  # (R,) [s]
    bare: Array  # (R,) [s]
    dm_control: Array  # (R,) [s]

    @property
    def title(self) -> str:
        return f"{self.seconds:.0f} s of flight"

    def comparisons(self) -> list[Comparison]:
        control_steps = self.seconds / (CONTROL_TICKS * TICK)
        ratio_of: Ratio = "ours / other"
        loop, bare, peer = (1e6 / control_steps * cpu for cpu in (self.loop, self.bare, self.dm_control))
        return [
            Comparison("a command, 5 steps", "us", loop, bare, BARE, ratio_of, at_most=AT_MOST),
            Comparison("a command, 5 steps", "us", loop, peer, DM_CONTROL, ratio_of),
        ]

    def show(self, console: Console) -> None:
        control_steps = self.seconds / (CONTROL_TICKS * TICK)
        added = 1e6 / control_steps * float(np.median(self.loop - self.bare))
        console.print(f"The loop adds {added:.1f} us to the five steps of a command.", highlight=False)

    def plain(self) -> dict[str, Any]:
        return {
            "simulated_s": self.seconds,
            "physics_hz": 1.0 / TICK,
            "control_hz": 1.0 / (CONTROL_TICKS * TICK),
            "loop_s": self.loop.tolist(),
            "bare_s": self.bare.tolist(),
            "dm_control_s": self.dm_control.tolist(),
        }


def run(arguments: Arguments, console: Console) -> LoopFindings:
    """Fly and replay in turns, and return the times."""
    rows: list[tuple[float, float, float]] = []
    with progress(console, "the loop beside its physics", arguments.repetitions) as report:
        warm = fly(arguments.terrain, arguments.seconds)
        bare_steps(warm), dm_control_steps(warm)
        for repetition in range(arguments.repetitions):
            flight = fly(arguments.terrain, arguments.seconds)
            rows.append((flight.cpu, bare_steps(flight), dm_control_steps(flight)))
            report(repetition + 1)
    loop, bare, peer = np.array(rows).T
    return LoopFindings(warm.seconds, loop, bare, peer)


def main(arguments: Arguments) -> None:
    alone("loop_overhead", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
