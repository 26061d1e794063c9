"""Scenarios whose empirical observability Gramians the study ``observability`` takes, and how they are commanded."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.observability import EmpiricalGramian, empirical_gramian
from mathnavi.sim.scenarios.range_localisation import VEHICLE as ROBOT
from mathnavi.sim.scenarios.safe_flight import VEHICLE as AIRCRAFT
from mathnavi.sim.scenarios.textbook import VEHICLE as CAMERA
from mathnavi.sim.studies.ranging.observability.maps import SENSORS, driving, standing
from mathnavi.sim.sweep.trial import trial

DEVIATION = 0.05  # of a reading, in its own unit, where all sensors of a scenario are alike
_SEED = 2


@dataclass(frozen=True)
class GramianCase:
    """A scenario, how it is commanded, and what of its state is moved."""

    scenario: str
    described: str  # as in a table
    estimator: str  # whose sensors are carried
    fields: Mapping[str, Any]
    vehicle: str
    input_at: Callable[[float], Sequence[float]]  # t [s] to u (nu,)
    period: float  # [s] over which an input is held
    duration: float  # [s]
    deltas: Mapping[str, float]  # by component of the state
    deviations: Mapping[str, float]  # by sensor

    def gramian(self) -> EmpiricalGramian:
        """W of the readings over the run, in units of their deviations."""
        wanted = trial(self.scenario, _SEED, estimator=self.estimator, fields=self.fields)
        n = round(self.duration / self.period)
        commands = np.array([self.input_at((k + 0.5) * self.period) for k in range(n)])
        return empirical_gramian(
            lambda: wanted.build().plant,
            self.vehicle,
            {self.vehicle: commands},
            round(self.period / wanted.build().plant.dt),
            self.deltas,
            self.deviations,
        )


@dataclass(frozen=True)
class GramianResult:
    """Directions that an empirical Gramian sees, and how well."""

    number: int  # in GRAMIANS
    unseen: int  # directions of the state that the readings say nothing of
    deviations: (
        Array  # (n,) principal standard deviations of what they say of the start, falling; infinite where unseen
    )
    worst: str  # the direction that they say least of

    @property
    def case(self) -> GramianCase:
        return GRAMIANS[self.number]


def observability_gramian(number: int) -> GramianResult:
    """The Gramian of one of ``GRAMIANS``, read: a direction of which they say nothing has the eigenvalue nought."""
    gramian = GRAMIANS[number].gramian()
    scales = np.ones(len(gramian.names))
    values, vectors = np.linalg.eigh(gramian.scaled(scales))
    unseen = len(gramian.unseen(scales))
    with np.errstate(divide="ignore"):
        deviations = 1.0 / np.sqrt(np.where(np.arange(len(values)) < unseen, 0.0, values))
    return GramianResult(number, unseen, deviations, _named(vectors[:, 0], gramian.names))


def _named(direction: Array, names: Sequence[str]) -> str:
    """A direction by its larger components."""
    sign = 1.0 if direction[np.argmax(np.abs(direction))] > 0.0 else -1.0
    large = [(sign * float(part), name.partition(" ")[0]) for part, name in zip(direction, names, strict=True)]
    return " ".join(f"{part:+.2f} {name.removeprefix('position_')}" for part, name in large if abs(part) > 0.1)


def _robot(sensors: str, moves: bool) -> GramianCase:
    deltas = {"position_x_1 [m]": 1e-4, "position_x_2 [m]": 1e-4, "position_phi [rad]": 1e-4}
    return GramianCase(
        "range-localisation",
        f"{len(SENSORS[sensors])} range sensor{'s' if len(SENSORS[sensors]) > 1 else ''}, "
        f"{'figure of eight' if moves else 'standing still'}, 2 s",
        "range_observer",
        {"sensors": SENSORS[sensors]},
        ROBOT,
        driving if moves else standing,
        0.01,
        2.0,
        deltas,
        {"ranges": DEVIATION},
    )


def _camera(distance_known: bool, u: tuple[float, float], described: str) -> GramianCase:
    deltas = {"x_1 [m]": 1e-4, "x_2 [m]": 1e-4, "phi [rad]": 1e-4} | ({} if distance_known else {"d_0 [m]": 1e-4})
    return GramianCase(
        "textbook-observer",
        f"Example C.2, d_0 {'known' if distance_known else 'unknown'}, {described}, 2 s",
        "textbook_ekf",
        {"system": "camera-and-flags", "distance_known": distance_known},
        CAMERA,
        lambda t: u,
        0.01,
        2.0,
        deltas,
        {"output": DEVIATION},
    )


def _aircraft(estimator: str, described: str, deviations: Mapping[str, float]) -> GramianCase:
    names = [f"{what}_{axis} [{unit}]" for what, unit in (("position", "m"), ("velocity", "m/s")) for axis in "xyz"]
    return GramianCase(
        "safe-flight",
        f"{described}, gusts, 20 s",
        estimator,
        {"noise.position": 5.0, "faults.gust_rms": 1.0},
        AIRCRAFT,
        lambda t: (0.0, 0.0, 0.0),
        1.0 / 60.0,
        20.0,
        dict.fromkeys(names, 1.0),
        deviations,
    )


GRAMIANS: tuple[GramianCase, ...] = (
    *(_robot(sensors, moves) for sensors in ("1", "2s", "3") for moves in (False, True)),
    *(
        _camera(known, u, described)
        for known in (True, False)
        for u, described in (((0.0, 0.6), "turning on the spot"), ((0.3, 0.0), "straight on"))
    ),
    _aircraft("kalman", "position fixes of 5 m, 10 a second", {"position": 5.0}),
)
