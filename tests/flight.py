"""Shared by the flight tests: mountains without a data file, missions over them, and a vehicle without MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Event, Measurement, Plan
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField

SIDE = 12_000.0  # [m]
SPACING = 200.0  # [m]
START, TARGET = (1500.0, 2000.0), (10_200.0, 9800.0)  # [m] on either side of the ridge


@cache
def mountains() -> HeightField:
    """A ridge across the map with peaks on it, from 300 to 2059 m, up to 53 degrees steep, on rough ground."""
    count = round(SIDE / SPACING) + 1
    x, y = np.meshgrid(np.arange(count) * SPACING, np.arange(count) * SPACING)
    along, across = (x - y) / np.sqrt(2.0), (x + y - SIDE) / np.sqrt(2.0)
    ridge = (900.0 + 350.0 * np.sin(along / 700.0)) * np.exp(-((across / 1600.0) ** 2))
    peaks = sum(
        height * np.exp(-((x - east) ** 2 + (y - north) ** 2) / 800.0**2)
        for east, north, height in ((4000.0, 7000.0, 700.0), (6500.0, 5500.0, 500.0), (8500.0, 9500.0, 600.0))
    )
    rough = np.random.default_rng(7).uniform(0.0, 60.0, x.shape)
    return HeightField(300.0 + ridge + peaks + rough, SPACING, name="test mountains")


def save(terrain: HeightField, path: Path) -> str:
    """Write a terrain as the file that a scenario takes."""
    meta = f'{{"spacing_m": {terrain.spacing}}}'
    np.savez(path, z=terrain.z.astype(np.float32), meta=np.array(meta))
    return str(path)


def above(terrain: HeightField, place: tuple[float, float], height: float) -> tuple[float, float, float]:
    """The point ``height`` [m] above the ground at ``place`` [m]."""
    return (*place, float(terrain.height(*place)) + height)


def mission(**fields: Any) -> FlightMission:
    """Across the ridge, from one low start to a low target."""
    terrain = mountains()
    return FlightMission(terrain, above(terrain, START, 150.0), above(terrain, TARGET, 150.0), **fields)


def at_rest(point: Sequence[float] | Array) -> Array:
    """(6,) the state of rest at a point (3,) [m]."""
    return np.array([*point, 0.0, 0.0, 0.0])


def assert_well_formed(plan: Plan) -> None:
    """Its arrays fit together and are finite, its arcs join, and it ends at rest."""
    arcs = len(plan.t) - 1
    assert arcs >= 1
    assert plan.x.shape == (arcs + 1, 6)
    assert plan.u.shape == (arcs, 3)
    assert plan.phase.shape == (arcs,)
    assert all(np.isfinite(values).all() for values in (plan.t, plan.x, plan.u))
    duration = np.diff(plan.t)[:, np.newaxis]
    assert (duration > 0.0).all()
    np.testing.assert_allclose(flow(plan.x[:-1], plan.u, duration), plan.x[1:], rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(plan.x[-1, 3:], 0.0)


class PointMass:
    """``mathnavi.interfaces.protocols.Plant`` without MuJoCo: one double integrator, exact, that reads its own
    state at every tick."""

    names = ("vehicle",)

    def __init__(self, start: Array, dt: float) -> None:
        self.dt = dt
        self._x, self._ticks, self._force = start.copy(), 0, np.zeros(3)
        self._readings = [self._reading()]

    @property
    def t(self) -> float:
        return self._ticks * self.dt

    def state(self, name: str) -> Array:
        return self._x.copy()

    def state_names(self, name: str) -> tuple[str, ...]:
        return tuple(f"{what}_{axis} [{unit}]" for what, unit in (("p", "m"), ("v", "m/s")) for axis in "xyz")

    def sensor_sizes(self, name: str) -> dict[str, int]:
        return {"full_state": 6}

    def sensors(self, name: str) -> tuple[Sensor, ...]:
        return ()

    def sense(self, name: str) -> Sequence[Measurement]:
        readings, self._readings = self._readings, []
        return readings

    def _reading(self) -> Measurement:
        return Measurement("full_state", self.t, self._x.copy())

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        self._force = self._force + force

    def displace(self, name: str, offset: Array) -> None:
        self._x[:3] += offset

    def place(self, name: str, state: Array) -> None:
        self._x = np.array(state)

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        for _ in range(ticks):
            self._x = flow(self._x, commands["vehicle"] + self._force, self.dt)
            self._ticks += 1
            self._readings.append(self._reading())
        self._force = np.zeros(3)
        return []
