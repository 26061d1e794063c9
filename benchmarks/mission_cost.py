"""Cost of a whole mission compared with its physics: thread CPU time of a run, from the first step to the summary.

    python -m benchmarks.mission_cost [--repetitions 5]

The mission of ``make fly``, with its planner, certificate, tracker, referee, log and metrics, is flown undisturbed, and
with noise, gusts, a Kalman filter and faults. For comparison ``mujoco.mj_step(model, data)`` repeats the commands of
the undisturbed flight in a Python loop and must end in the same state. A disturbed flight takes another path and
another time, so times are compared per second of flight.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge

from benchmarks.arguments import read_arguments
from mathnavi.interfaces.bounds import Within, configuration

os.environ.setdefault("MUJOCO_GL", "disable")

import numpy as np
from rich.console import Console

from benchmarks.comparison import Comparison, alone
from benchmarks.loop_overhead import BARE, Flight, bare_steps, timed
from benchmarks.progress import progress
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.scenarios.safe_flight import VEHICLE
from mathnavi.sim.sweep.trial import Trial, trial

MISSION: dict[str, Any] = {
    "start": (12_000.0, 14_000.0, 2924.0),
    "target": (63_000.0, 62_000.0, 5258.0),
    "radar": ((36_000.0, 39_000.0, 10_000.0, 10.0),),
    "radar_time": 40.0,
}
DISTURBED: dict[str, Any] = {
    "noise.position": 5.0,
    "faults.gust_rms": 1.5,
    "faults.solver_failure_rate": 0.1,
    "faults.late_plan_rate": 0.1,
}
AT_MOST, AT_MOST_DISTURBED = 1.5, 2.5  # times the bare steps


@configuration
class Arguments:
    """Compare the cost of a mission with that of its physics."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 5
    """number of flights of each mission"""
    out: Path = Path("renders/out/mission_cost.json")
    """file of the figures"""


def missions(terrain: str, mission: dict[str, Any]) -> tuple[Trial, Trial]:
    """Return the undisturbed mission and the disturbed one."""
    fields = {"terrain": terrain, **mission}
    return trial(seed=1, fields=fields), trial(seed=1, estimator="kalman", fields=fields | DISTURBED)


def fly(mission: Trial) -> tuple[Plant, Recording, float]:
    """Fly a whole mission; return its plant, its recording, and the thread CPU time [s] per second of flight."""
    closed_loop = mission.build()
    outcome, cpu = timed(closed_loop.run)
    return closed_loop.plant, outcome.recording, cpu / float(outcome.t[-1])


def repeated(plant: Plant, recording: Recording) -> float:
    """Return the thread CPU time [s] per second of flight of MuJoCo's steps alone, in a flight without disturbances."""
    assert isinstance(plant, MujocoPlant)
    truth = recording.truths[VEHICLE][: recording.length]
    commands = recording.agents[VEHICLE].commands[: len(truth) - 1]
    flight = Flight(plant.model, truth[0], truth[-1], commands, cpu=math.nan)
    return bare_steps(flight) / flight.seconds


@dataclass(frozen=True, eq=False)
class MissionFindings:
    """Thread CPU time per second of flight of each run."""

    seconds: float  # [s] of the mission as it is
    mission: Array  # (R,) [ms/s]
    disturbed: Array  # (R,) [ms/s]
    bare: Array  # (R,) [ms/s]

    @property
    def title(self) -> str:
        return f"a mission of {self.seconds:.0f} s, a second of flight"

    def comparisons(self) -> list[Comparison]:
        return [
            Comparison("as it is", "ms", self.mission, self.bare, BARE, "ours / other", at_most=AT_MOST),
            Comparison(
                "noise, gusts, Kalman filter, faults", "ms", self.disturbed, self.bare, BARE, "ours / other",
                at_most=AT_MOST_DISTURBED,
            ),
        ]  # fmt: skip

    def show(self, console: Console) -> None:
        whole = 1e-3 * self.seconds * float(np.median(self.mission))
        console.print(f"The mission takes {whole:.2f} s of CPU time.", highlight=False)

    def plain(self) -> dict[str, Any]:
        return {
            "simulated_s": self.seconds,
            "mission_ms": self.mission.tolist(),
            "disturbed_ms": self.disturbed.tolist(),
            "bare_ms": self.bare.tolist(),
        }


def run(arguments: Arguments, console: Console, mission: dict[str, Any] = MISSION) -> MissionFindings:
    """Fly and replay in turns, and return the times."""
    rows: list[tuple[float, float, float]] = []
    calm, disturbed = missions(arguments.terrain, mission)
    with progress(console, "missions beside their physics", arguments.repetitions) as report:
        warm = fly(calm)
        fly(disturbed), repeated(*warm[:2])
        for repetition in range(arguments.repetitions):
            plant, recording, cpu = fly(calm)
            rows.append((cpu, fly(disturbed)[2], repeated(plant, recording)))
            report(repetition + 1)
    flown, other, bare = 1e3 * np.array(rows).T
    return MissionFindings(float(recording.t[recording.length - 1]), flown, other, bare)


def main(arguments: Arguments) -> None:
    alone("mission_cost", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
