"""Assembler of a scenario's closed loop from the parts that all scenarios share.

    plug-ins        the scenario's defaults if none are given, checked against the mission
    random streams  one for each source of chance, in the order that the scenario lists
    faults          of every group of faults in the configuration, around planner, sensors and plant
    assurance       around planner and tracker, if the scenario passes one: a certificate, for example
    record          config.json: enough to build the same loop again, and to draw its run

The scenario supplies the rest: its mission, vehicle, referee, metrics and task.
"""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from mathnavi.interfaces.fields import plain
from mathnavi.interfaces.protocols import Estimator, Planner, Plant, Sensor
from mathnavi.interfaces.signals import Array, Message
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.network import Network
from mathnavi.sim.plugin.code_version import code_version
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller, checked_estimator, checked_sensors, load
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.fault_fields import Fault, kinds
from mathnavi.sim.scenarios.redraw import BlockGenerator, generator
from mathnavi.sim.scenarios.task import Task

_UNLISTED = 2**32 - 1  # in the spawn key of a stream that is not listed, where no child that is counted ever comes


class RandomStreams:
    """The random generators of a run by name, one for each source of chance, all spawned from its seed.

    The listed ones are the children of ``root``, in the order of their names. Any other name has a generator too,
    which follows from the seed and the name alone: a new random stream leaves the draws of all others unchanged.
    """

    def __init__(
        self,
        root: np.random.Generator,
        names: Sequence[str] = (),
        given: Mapping[str, np.random.Generator] | None = None,
    ) -> None:
        self.root = root
        """generator that all others are spawned from"""
        self._named = {**(given or {}), **dict(zip(names, root.spawn(len(names)), strict=True))}

    def __getitem__(self, name: str) -> np.random.Generator:
        if name not in self._named:
            parent = self.root.bit_generator.seed_seq
            assert isinstance(parent, np.random.SeedSequence)
            key = (*parent.spawn_key, _UNLISTED, zlib.crc32(name.encode()))
            redraws = self.root.redraws if isinstance(self.root, BlockGenerator) else ()
            self._named[name] = generator(np.random.SeedSequence(parent.entropy, spawn_key=key), redraws)
        return self._named[name]

    def split(self, name: str, count: int) -> list[RandomStreams]:
        """Streams for each of ``count`` vehicles, whose ``name`` is a child of the common stream ``name``."""
        return [RandomStreams(child, given={name: child}) for child in self[name].spawn(count)]


class Assurance(Protocol):
    """Run-time assurance of one vehicle: what stands between its planner and its actuators."""

    @property
    def bound(self) -> type:
        """Type of the bound that the tracker states."""
        ...

    def around(self, planner: Planner, tracker: Any) -> tuple[Planner, Any]:
        """Return planner and tracker with this assurance."""
        ...


@dataclass(frozen=True)
class VehicleStack:
    """Sensors, estimator, planner and tracker of one vehicle, in the order in which data flows."""

    sensors: tuple[Sensor, ...]
    estimator: Estimator
    planner: Planner
    tracker: Any
    asked: tuple[str, ...]  # names of the sensors that the estimator requests

    def agent(self, input_size: int = 3, messages: Sequence[Message] = (), **others: Any) -> Agent:
        """Agent with this stack; ``messages`` reach the planner at their times, ``others`` are fields of the agent."""
        return Agent(self.estimator, self.planner, self.tracker, input_size, messages, sensors=self.asked, **others)


@dataclass(frozen=True)
class Assembler:
    """Builder of one closed loop of a scenario, for one seed; ``faults=()`` builds it without faults."""

    scenario: Any  # its class
    config: Any  # of the scenario's Config
    seed: int
    controller: PluginSpec
    estimator: PluginSpec
    streams: RandomStreams
    faults: tuple[Fault, ...]  # the groups of faults in the configuration

    @staticmethod
    def for_scenario(
        scenario: Any, config: Any, seed: int, controller: PluginSpec | None, estimator: PluginSpec | None
    ) -> Assembler:
        """Assembler of a scenario's class, with the scenario's default plug-ins if none are given.

        ``scenario.streams`` lists the names of the random streams, in the order in which they are spawned; without it
        no stream is listed.
        """
        groups = (getattr(config, field.name) for field in dataclasses.fields(config))
        return Assembler(
            scenario, config, seed,
            controller or PluginSpec.with_fields(load("controllers", scenario.controller)),
            estimator or PluginSpec.with_fields(load("estimators", scenario.estimator)),
            RandomStreams(
                generator(np.random.SeedSequence(seed), getattr(config, "redraw", ())), getattr(scenario, "streams", ())
            ),
            tuple(group for group in groups if isinstance(group, Fault)),
        )  # fmt: skip

    # ---- what a vehicle flies with

    def stack(self, mission: Any, *others: Sensor, assurance: Assurance | None = None) -> VehicleStack:
        """Autonomy stack of a vehicle, with its faults; ``others`` are sensors in addition to those of the estimator.

        ``assurance`` is put around the faulty planner and the tracker. PluginError for a plug-in that does not fit the
        mission, and for a tracker without the bound that the assurance needs.
        """
        raw, tracker = checked_controller(self.controller, mission, None if assurance is None else assurance.bound)
        estimator = self.observer(mission)
        planner, sensors = self.with_planner_faults(raw), self.sensors(mission, *others)
        if assurance is not None:
            planner, tracker = assurance.around(planner, tracker)
        return VehicleStack(sensors, estimator, planner, tracker, self.asked(mission))

    def observer(self, mission: Any) -> Estimator:
        """Estimator alone; raises PluginError if it does not fit the mission."""
        return checked_estimator(self.estimator, mission)

    def asked(self, mission: Any) -> tuple[str, ...]:
        """Names of the sensors that the estimator requests."""
        return tuple(sensor.name for sensor in checked_sensors(self.estimator, mission))

    def sensors(self, mission: Any, *others: Sensor, streams: RandomStreams | None = None) -> tuple[Sensor, ...]:
        """Sensors that the estimator requests, and ``others``, with their faults."""
        carried = (*checked_sensors(self.estimator, mission), *others)
        for faults, kind, stream in self._faults(streams):
            rngs = stream.spawn(len(carried))  # each sensor draws from its own generator
            carried = tuple(kind.on_sensor(faults, sensor, rng) for sensor, rng in zip(carried, rngs, strict=True))
        return carried

    def with_planner_faults(self, planner: Planner, streams: RandomStreams | None = None) -> Planner:
        """Planner with the faults of the configuration."""
        for faults, kind, stream in self._faults(streams):
            planner = kind.on_planner(faults, planner, stream)
        return planner

    def _faults(self, streams: RandomStreams | None = None) -> Iterator[tuple[Fault, type[Fault], np.random.Generator]]:
        """Every fault: its fields, its class, and its random stream, from ``streams`` or those of the run."""
        for faults in self.faults:
            for kind in kinds(faults):
                yield faults, kind, (streams or self.streams)[kind.stream]

    # ---- plant

    def disturbed(self, plant: Plant, period: float, *, mass: float) -> Plant:
        """Plant with its disturbances, for vehicles of a mass [kg] and planners of a period [s]; unchanged without any.

        ``mass`` is the true one: forces per mass are multiplied by it.
        """
        acting = [
            disturbance
            for faults, kind, stream in self._faults()
            for disturbance in kind.disturbances(faults, mass, period, stream)
        ]
        return Disturbed(plant, acting) if acting else plant

    # ---- closed loop

    def closed_loop(
        self,
        plant: Plant,
        agents: Mapping[str, Agent],
        duration: float,
        finished: Callable[[float, Mapping[str, Array]], bool],
        summarise: Callable[[Recording, float], tuple[dict[str, Any], bool]],
        *,
        mission: Any,
        resolved: Any = None,
        terrain: Mapping[str, Any] | None = None,
        network: Network | None = None,
        task: Task | None = None,
    ) -> ClosedLoop:
        """Closed loop, with its config.json.

        ``mission`` is the record of the mission, for example a dataclass of ``mathnavi.sim.records.missions``;
        ``resolved`` is the configuration with all values that were drawn, the given one if None; ``terrain`` has its
        name, path and digest.
        """
        declared = getattr(self.scenario, "estimands", None)
        estimands = None if declared is None else partial(declared, self.config if resolved is None else resolved)
        record = self._record(mission, resolved, terrain)
        return ClosedLoop(plant, agents, duration, finished, summarise, record, network, task, estimands=estimands)

    def _record(self, mission: Any, resolved: Any, terrain: Mapping[str, Any] | None) -> dict[str, Any]:
        """Content of config.json without the versions."""
        drawing = getattr(self.scenario, "drawing", None)
        place = f"{self.scenario.__module__}:{self.scenario.__qualname__}"
        spec = RunSpec(getattr(self.scenario, "name", place), self.config, self.controller, self.estimator, self.seed)
        return {
            "scenario": spec.scenario,
            **({} if drawing is None else {"drawing": drawing}),
            "seed": self.seed,
            "fields": plain(self.config if resolved is None else resolved),
            "controller": _plugin_record(self.controller),
            "estimator": _plugin_record(self.estimator),
            "inputs": spec.inputs(),
            "code": code_version(self.scenario, *spec.plugins, need_sources=False),
            **({} if terrain is None else {"terrain": terrain}),
            "mission": plain(mission),
        }


def _plugin_record(part: PluginSpec) -> dict[str, Any]:
    return {"name": part.name, "fields": plain(part.config)}
