"""Data, chance and contacts of the missions of which a vector environment steps many at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from mathnavi.controllers.flight.cost_to_go import FactoredCost
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.loop import whole_ticks
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.engine.sensing import mounted
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.scenarios.flight_learning import FlightTerms, cost_to_go
from mathnavi.sim.scenarios.safe_flight import VEHICLE


@dataclass(frozen=True, eq=False)
class Mission:
    """Data of a mission for its rows."""

    flight: FlightMission  # as known at the start
    cost: FactoredCost
    deadline: float  # [s]

    @staticmethod
    def from_terms(terms: FlightTerms) -> Mission:
        flight = terms.missions[VEHICLE]
        return Mission(flight, cost_to_go(flight), terms.deadline)


@dataclass(frozen=True, eq=False)
class Chance:
    """Random generators of an episode, used as by the plant of a single environment."""

    noise: np.random.Generator  # of the full-state sensor
    gusts: np.random.Generator

    @staticmethod
    def from_seed(runner: EpisodeRunner, seed: int) -> Chance:
        streams, plant = runner.streams(seed), runner.plant
        own = streams["sensing"].spawn(1)[0]  # of the plant's only vehicle
        sensors = mounted(VEHICLE, plant.sensors(VEHICLE), plant.dt, own)
        noise = next(each.rng for each in sensors if each.sensor.name == "full_state")
        return Chance(noise, streams["gusts"])


class Contacts:
    """Simulator of control steps of one vehicle by MuJoCo, in a model without others."""

    def __init__(self, plant: MujocoPlant, h: float) -> None:
        self._model, self._data = plant.model, mujoco.MjData(plant.model)
        self._ticks = whole_ticks(h, plant.dt, "the control period")
        self._body = int(plant.model.jnt_bodyid[0])

    def step(self, x: Array, u: Array, gust: Array) -> bool:
        """Advance the state x (6,) in place under u and a gust (3,) [m/s^2]; True if it touches."""
        data, touched = self._data, False
        mujoco.mj_resetData(self._model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = x[:3], x[3:], u
        data.xfrc_applied[self._body, :3] = gust  # its mass is 1 kg
        for _ in range(self._ticks):
            mujoco.mj_step(self._model, data)
            touched |= data.ncon > 0
        x[:3], x[3:] = data.qpos, data.qvel
        return touched


def refusal(name: str, value: Any) -> str:
    return (
        f"{name} = {value!r} is not computed for many missions at once; allowed: its default, or "
        'vectorization_mode="async"'
    )


def flight_terms(runner: EpisodeRunner) -> FlightTerms:
    terms = runner.terms
    assert isinstance(terms, FlightTerms)
    return terms


def checked_plant(runner: EpisodeRunner) -> MujocoPlant:
    """Return the plant of a mission; ArgumentError for fields that are not supported for many rows at once."""
    config = runner.config
    for name, value in (
        ("target_path", config.target_path),
        ("faults.dropout_rate", config.faults.dropout_rate),
        ("faults.position_jump", config.faults.position_jump),
    ):
        if value:
            raise ArgumentError(refusal(name, value))
    plant = runner.plant.plant if isinstance(runner.plant, Disturbed) else runner.plant
    assert isinstance(plant, MujocoPlant)
    return plant


def steepest(terrain: HeightField) -> float:
    """Return the slope of the steepest triangle."""
    east, north = np.diff(terrain.z, axis=1), np.diff(terrain.z, axis=0)
    below_diagonal, above_diagonal = np.hypot(east[:-1], north[:, 1:]), np.hypot(east[1:], north[:, :-1])
    return float(max(below_diagonal.max(), above_diagonal.max())) / terrain.spacing
