"""What a scenario builds: a closed loop that is ready to run, and what its outcome means."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.engine.network import Network
from mathnavi.sim.interfaces.protocols import Plant
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.run_folder import write_run
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
    """A closed loop, built for one seed; it runs once."""

    plant: Plant
    agents: Mapping[str, Agent]
    duration: float  # [s] at most
    finished: Callable[[float, Mapping[str, Array]], bool]
    summarise: Callable[[Recording, float], tuple[dict[str, Any], bool]]  # (recording, wall seconds)
    config: dict[str, Any]
    network: Network | None = None  # of a fleet
    task: Task | None = None  # for whoever commands the actuators; None: nobody else than the controller can

    def run(self, progress: Callable[[float], None] | None = None) -> RunResult:
        """Simulate and judge; ``progress`` is told the simulated time [s]."""
        began = time.perf_counter()
        recording = simulate(self.plant, self.agents, self.duration, self.finished, progress, self.network)
        summary, success = self.summarise(recording, time.perf_counter() - began)
        return RunResult(recording, summary, self.config, success)


def recorded(
    scenario: str, drawing: str, seed: int, config: Any, controller: PluginSpec, estimator: PluginSpec, **beside: Any
) -> dict[str, Any]:
    """What config.json holds beside the versions: enough to build the same experiment, and to draw its run."""
    return {
        "scenario": scenario,
        "drawing": drawing,
        "seed": seed,
        "fields": dataclasses.asdict(config),
        "controller": {"name": controller.name, "fields": dataclasses.asdict(controller.config)},
        "estimator": {"name": estimator.name, "fields": dataclasses.asdict(estimator.config)},
        **beside,
    }
