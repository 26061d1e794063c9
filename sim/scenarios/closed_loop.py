"""A closed loop that is ready to run, which a scenario builds, and the result of its run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording, write_run
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.engine.network import Network
from mathnavi.sim.interfaces.protocols import Plant
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.scenarios.task import Task


@dataclass(frozen=True)
class RunResult:
    """A run: its arrays by dotted name, its summary, and whether the mission did what it should."""

    recording: Recording
    summary: dict[str, Any]
    config: dict[str, Any]
    success: bool

    @property
    def arrays(self) -> dict[str, Array]:
        return self.recording.arrays()

    def write(self, folder: Path) -> None:
        """Write the run's folder."""
        write_run(folder, self.config, self.summary, self.recording)


@dataclass(frozen=True)
class ClosedLoop:
    """A closed loop, built for one seed; it runs once.

    ``finished(t, truths)`` is the referee: it sees the true states, (nx,) by vehicle, at t [s]. ``summarise(recording,
    wall_seconds)`` returns the summary, and whether the mission did what it should.
    """

    plant: Plant
    agents: Mapping[str, Agent]
    duration: float  # [s] at most
    finished: Callable[[float, Mapping[str, Array]], bool]
    summarise: Callable[[Recording, float], tuple[dict[str, Any], bool]]
    config: dict[str, Any]  # what config.json holds beside the versions
    network: Network | None = None  # of a fleet
    task: Task | None = None  # for whoever commands the actuators; None: nobody else than the controller can

    def run(self, progress: Callable[[float], None] | None = None) -> RunResult:
        """Simulate and evaluate; ``progress`` is called with the simulated time [s]."""
        began = time.perf_counter()
        recording = simulate(self.plant, self.agents, self.duration, self.finished, progress, self.network)
        summary, success = self.summarise(recording, time.perf_counter() - began)
        return RunResult(recording, summary, self.config, success)
