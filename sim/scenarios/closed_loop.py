"""A closed loop that is ready to run, which a scenario builds, and the result of its run."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.reading.files import MOST_LINES, read_bytes
from mathnavi.interfaces.signals import DIVERGED, Array, Event
from mathnavi.interfaces.writing import write_bytes
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.answer_times import COMPONENTS, Latency
from mathnavi.sim.engine.compilation import compilation_timed
from mathnavi.sim.engine.contact_messages import declaration_at_start
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.loop import Loop, simulate
from mathnavi.sim.engine.network import Network
from mathnavi.sim.metrics.planning import planner_status
from mathnavi.sim.metrics.unused_readings import unused_figures
from mathnavi.sim.records.claimed_folder import claimed
from mathnavi.sim.records.figure_names import PLANNER_STATUS, SHORTFALL
from mathnavi.sim.records.run_folder import RECORDED, write_run, write_run_files
from mathnavi.sim.records.timing import LATENCY, PlansTake, Timing
from mathnavi.sim.scenarios.declared_signals import Estimands, check_declared, name_signals
from mathnavi.sim.scenarios.task import Task

REHEARSED = 3  # planning periods, in which most kernels of a run are called


def _scene(plant: Plant, recording: Recording) -> dict[str, Array] | None:
    from mathnavi.sim.engine.scene_record import scene_arrays  # imports mujoco

    return scene_arrays(plant, recording)


@dataclass(frozen=True, eq=False, repr=False)
class RunData:
    """Data of a run: its arrays by dotted name, summary, events, and whether the mission succeeded.

    ``run["truth.x"]`` is an array of the log, (n, nx) by control step; ``run.arrays`` names them all.
    """

    recording: Recording
    summary: dict[str, Any]  # figures by name, the unit at its end: "min_clearance_m"
    config: dict[str, Any]  # content of config.json: scenario, seed, every field, the plug-ins
    success: bool
    folder: Path | None = None  # folder that it was read from or saved in
    scene: Callable[[], dict[str, Array] | None] | None = None  # makes the arrays of its scene, if it is drawn by them
    timing: Timing | None = None  # wall-clock times of its components' answers, which no other run repeats

    @cached_property
    def arrays(self) -> dict[str, Array]:
        """Every array of log.npz by its dotted name (``mathnavi.sim.engine.log``)."""
        return self.recording.arrays()

    def __getitem__(self, name: str) -> Array:
        """Array of a dotted name; KeyError lists those that exist."""
        if name not in self.arrays:
            raise KeyError(f"{name!r} is not in the log; {allowed_for(name, sorted(self.arrays))}")
        return self.arrays[name]

    @property
    def t(self) -> Array:
        """Times (n,) [s] of the control steps."""
        return self.recording.t

    @property
    def events(self) -> list[Event]:
        """Events in order of time."""
        return self.recording.events

    def scene_arrays(self) -> dict[str, Array] | None:
        """Arrays of the scene; None for a run that is drawn without them."""
        return None if self.scene is None else self.scene()

    def write(self, folder: Path) -> None:
        """Write the run's folder, whole or not at all."""
        write_run(folder, self.config, self.summary, self.recording, self.scene_arrays(), self.timing)

    def write_files(self, folder: Path) -> None:
        """Write the files of the run into an existing folder."""
        write_run_files(folder, self.config, self.summary, self.recording, self.scene_arrays(), self.timing)

    def save(self, folder: str | Path) -> Path:
        """Write config.json, summary.json, events.jsonl, log.npz, log.json and timing.json into a folder; return it.

        A run that was read from a folder is copied unchanged. The folder is replaced as a whole; other files in it are
        kept. Raises OSError where it cannot be written, RunFolderError where another process is writing it.
        """
        target = Path(folder)
        if self.folder is None:
            self.write(target)
        elif target.resolve() != self.folder.resolve():
            with claimed(target) as claim:
                for name in RECORDED:
                    if (self.folder / name).is_file():
                        write_bytes(claim.new / name, read_bytes(self.folder / name, RunFolderError, MOST_LINES))
                claim.install(dropped=RECORDED)
        object.__setattr__(self, "folder", target)
        return target


@dataclass(frozen=True)
class ClosedLoop:
    """A closed loop, built for one seed; it runs once.

    ``finished(t, truths)`` is the referee: it gets the true states, (nx,) by vehicle, at t [s]. ``summarise(recording,
    wall_seconds)`` returns the summary, and whether the mission succeeded.
    """

    plant: Plant
    agents: Mapping[str, Agent]
    duration: float  # [s] at most
    finished: Callable[[float, Mapping[str, Array]], bool]
    summarise: Callable[[Recording, float], tuple[dict[str, Any], bool]]
    config: dict[str, Any]  # content of config.json without the versions
    network: Network | None = None  # of a fleet
    task: Task | None = None  # for commands from outside; None if only the controller can command the actuators
    timed: Collection[str] = COMPONENTS  # components whose answers are computed in the run
    estimands: Estimands | None = None  # what there is to estimate; None where the scenario does not declare it

    def run(
        self,
        progress: Callable[[float], None] | None = None,
        again: Callable[[], ClosedLoop] | None = None,
        watch: Callable[[Loop], None] | None = None,
        latency: Latency | None = None,
    ) -> RunData:
        """Simulate and evaluate the run; ``progress`` is called with the simulated time [s], ``watch`` with the loop
        after every step. ``latency`` is the simulated time that plans take, none if not given.

        ``again`` builds the same closed loop once more. With it, a run in whose first planning periods kernels were
        compiled is a rehearsal: it ends there, and the run is flown from a fresh closed loop. Time spent compiling
        later is left out of the wall-clock time. A run whose simulation diverged has failed, regardless of its figures.
        Raises as ``simulate`` does.
        """
        check_declared(self.plant, self.agents, self.estimands)
        rehearsed = REHEARSED * max((agent.planner.period for agent in self.agents.values()), default=0.0)
        rehearsing = again is not None
        with compilation_timed() as compilation:

            def over(t: float, truths: Mapping[str, Array]) -> bool:
                nonlocal rehearsing
                if rehearsing and t >= rehearsed:
                    if compilation.seconds > 0.0:
                        return True
                    rehearsing = False
                return self.finished(t, truths)

            began = time.perf_counter()
            recording = simulate(self.plant, self.agents, self.duration, over, progress, self.network, watch, latency)
            wall_seconds = time.perf_counter() - began - compilation.seconds
        if again is not None and rehearsing and compilation.seconds > 0.0:
            return again().run(progress, watch=watch, latency=latency)
        name_signals(recording, self.agents, self.task, self.estimands)
        summary, success = self.summarise(recording, wall_seconds)
        asked = {name: agent.sensors for name, agent in self.agents.items()}
        summary = {**summary, **unused_figures(recording, asked)}
        if not success and (declared := declaration_at_start(recording.events, float(recording.t[-1]))):
            summary = {**summary, SHORTFALL: "; ".join(filter(None, [summary.get(SHORTFALL), declared]))}
        if lost := next((event for event in recording.events if event.kind == DIVERGED), None):
            summary, success = {**summary, SHORTFALL: f"at {lost.t:.6g} s {lost.message}"}, False
        if status := planner_status(recording):
            summary = {**summary, PLANNER_STATUS: status}
        drawn = self.config.get("drawing") is not None or "terrain" in self.config
        scene = None if drawn else partial(_scene, self.plant, recording)
        plans_take: PlansTake = "no time" if latency is None else "measured" if latency.recorded is None else "recorded"
        config = self.config if latency is None else {**self.config, LATENCY: "measured"}
        timing = Timing.of(recording, self.timed, plans_take)
        known = timing if any(timing.vehicles.values()) else None
        return RunData(recording, summary, config, success, scene=scene, timing=known)
