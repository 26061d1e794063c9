"""What a scenario builds: a closed loop that is ready to run, and what its outcome means."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim.cockpit import Agent
from sim.log import Recording, write_run
from sim.loop import simulate
from sim.network import Network
from sim.plugins import Part
from sim.protocols import Plant
from sim.scenarios.task import Task
from sim.signals import Array


@dataclass(frozen=True)
class Outcome:
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
class Experiment:
    """A closed loop, built for one seed; it runs once."""

    plant: Plant
    agents: Mapping[str, Agent]
    duration: float  # [s] at most
    finished: Callable[[float, Mapping[str, Array]], bool]
    summarise: Callable[[Recording, float], tuple[dict[str, Any], bool]]  # (recording, wall seconds)
    config: dict[str, Any]
    network: Network | None = None  # of a fleet
    task: Task | None = None  # for whoever commands the actuators; None: nobody else than the controller can

    def run(self, progress: Callable[[float], None] | None = None) -> Outcome:
        """Simulate and judge; ``progress`` is told the simulated time [s]."""
        began = time.perf_counter()
        recording = simulate(self.plant, self.agents, self.duration, self.finished, progress, self.network)
        summary, success = self.summarise(recording, time.perf_counter() - began)
        return Outcome(recording, summary, self.config, success)


def recorded(
    scenario: str, drawing: str, seed: int, config: Any, controller: Part, estimator: Part, **beside: Any
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
