"""Missions and plans that the tests of the missile's controllers share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mathnavi.controllers.missile.plugin import MissileConfig, MissileController
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL, Coordinates
from mathnavi.models.missile.mission import CASES, MissileMission, Target

INPUT_MAX = {PLANAR: (20e3, 60e3, 3e3), SPATIAL: (20e3, 60e3, 60e3, 3e3, 3e3)}


def mission(coordinates: Coordinates = PLANAR, case: str = "SM2", **changes: Any) -> MissileMission:
    """The dive of the design study."""
    start = {"u": CASES[case].speed, "z_e": -10.0}
    fields: dict[str, Any] = {
        "start": tuple(start.get(name, 0.0) for name in coordinates.states),
        "target": Target((700.0, 0.0, 0.0)),
        "case": CASES[case],
        "coordinates": coordinates,
        "input_max": INPUT_MAX[coordinates],
    }
    return MissileMission(**fields | changes)


def built(guidance: MissileMission, **fields: Any) -> tuple[Planner, Tracker]:
    """Planner and autopilot; in CasADi's virtual machine, which starts sooner."""
    return MissileController.build(MissileConfig(**{"backend": "fatrop"} | fields), guidance)


def first_plan(guidance: MissileMission, **fields: Any) -> Plan:
    """The plan at the start."""
    planner, _ = built(guidance, **fields)
    plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, guidance.start_state), None))
    assert plan.ok, plan.message
    return plan


def miss(plan: Plan, guidance: MissileMission) -> float:
    """[m] between the end of a plan and the target then."""
    place = guidance.coordinates.place(plan.x[-1])
    return math.dist(place.tolist(), guidance.target.at(plan.t_end).tolist())


def deviation(guidance: MissileMission, size: float, seed: int = 0) -> Array:
    """(nx,) of a state: metres, metres a second, hundredths of a radian."""
    unit = {"m": 1.0, "m/s": 1.0, "rad": 0.01, "rad/s": 0.01}
    scale = np.array([unit[name] for name in guidance.coordinates.units])
    return size * scale * np.random.default_rng(seed).standard_normal(len(scale))
