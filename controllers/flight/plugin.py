"""The plug-in ``flight``: receding-horizon planner, certificate and tracker for a FlightMission."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from controllers.flight.certificate import Certificate
from controllers.flight.checks import check_fields
from controllers.flight.cost_to_go import FactoredCost, factored_cost
from controllers.flight.planner import RecedingHorizon, Solver
from controllers.flight.problem import Parameters
from controllers.flight.sqp import GaussNewton
from controllers.flight.tracker import CriticallyDamped, tracking_bound
from models.aerial.mission import FlightMission
from models.terrain.height_field import HeightField
from models.terrain.visibility import Radar
from sim.protocols import Planner, Tracker

_INSIDE = 1.0 - 1e-4  # the solver aims this far inside the bounds, so that its tolerance does not cost a plan


@dataclass(frozen=True)
class FlightConfig:
    """Fields of ``--planner``."""

    nodes: int = 13
    """N, nodes of the horizon"""
    horizon: float | None = None
    """T_p [s]; (nodes - 1) 5/3 if not given"""
    beta: float = 100.0
    """cost of a second against a squared acceleration [m^2/s^4]"""
    margin: float = 25.0
    """what the optimiser keeps above h_min, softly [m]"""
    backend: Literal["condensed", "ipopt", "fatrop"] = "condensed"
    """solver of the optimisation problem"""
    tolerance: float = 1e-6
    """relative gain at which the solver stops"""
    grid_nodes: int = 65
    """rows and columns of the cost-to-go's grid"""
    grid_layers: int = 9
    """its layers"""
    bandwidth: float = 0.8
    """of the tracker [rad/s]"""

    def __post_init__(self) -> None:
        check_fields(self, 2, ("horizon", "beta", "bandwidth", "tolerance"))
        if not (math.isfinite(self.margin) and self.margin >= 0.0):
            raise ValueError(f"margin = {self.margin!r}; allowed: a finite value >= 0")
        if self.backend not in ("condensed", "ipopt", "fatrop"):
            raise ValueError(f"backend = {self.backend!r}; allowed: condensed, ipopt, fatrop")

    @property
    def h(self) -> float:
        """Length of an arc [s]."""
        horizon = self.horizon if self.horizon is not None else (self.nodes - 1) * 5.0 / 3.0
        return horizon / (self.nodes - 1)


class SafeFlight:
    """Receding horizon with a safety manoeuvre behind every plan, optimised on line and certified."""

    Config = FlightConfig
    certified = True  # the scenario flies only what a certificate accepts

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        bound = tracking_bound(config.bandwidth, mission)
        certificate = Certificate.of(mission, bound)
        period = max(1, round(config.h / mission.control_period)) * mission.control_period
        parameters = Parameters(
            arcs=config.nodes - 1,
            h=config.h,
            speed_max=certificate.speed_max * _INSIDE,
            acceleration_max=certificate.acceleration_max * _INSIDE,
            beta=config.beta,
            clearance=mission.clearance_min + config.margin,
        )

        def cost_to_go(radars: tuple[Radar, ...]) -> FactoredCost:
            return _cost_to_go(mission.terrain, mission.target, radars, config.grid_nodes, config.grid_layers)

        planner = RecedingHorizon(parameters, certificate, solver(config), cost_to_go, mission.radars, period)
        return planner, CriticallyDamped(mission.control_period, config.bandwidth, bound)


def solver(config: FlightConfig) -> Solver:
    """The solver that the configuration names."""
    if config.backend == "condensed":
        return GaussNewton(config.tolerance)
    from controllers.flight.reference import Reference  # CasADi takes a while to import

    return Reference(config.backend, config.tolerance)


@lru_cache(maxsize=8)
def _cost_to_go(
    terrain: HeightField, target: tuple[float, float, float], radars: tuple[Radar, ...], nodes: int, layers: int
) -> FactoredCost:
    return factored_cost(terrain, np.array(target), radars, nodes, layers)
