"""The plug-in ``quadrotor``: the flight planner as it is, and beneath it a tracker that moves four rotors.

The two time scales of Fig. A.9: the planner moves a double integrator every period, the tracker the quadrotor many
times in between. What the tracker keeps enters the planner's certificate as its tracking bound.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from controllers.flight.plugin import FlightConfig, planner
from controllers.quadrotor.bound import tracking_bound
from controllers.quadrotor.tracker import GeometricTracker, TrackerConfig
from models.quadrotor.mission import QuadrotorMission
from sim.protocols import Planner, Tracker


def _flight() -> FlightConfig:
    """The planner's fields at a quadrotor's speeds: arcs of half a second, and a margin of a few metres."""
    return FlightConfig(nodes=13, horizon=6.0, beta=60.0, margin=2.0)


@dataclass(frozen=True)
class QuadrotorConfig:
    """Fields of ``--planner``."""

    flight: FlightConfig = field(default_factory=_flight)
    """the planner's; its ``bandwidth`` belongs to another tracker and is not used"""
    tracker: TrackerConfig = field(default_factory=TrackerConfig)


class QuadrotorFlight:
    """Receding horizon over a double integrator, certified for the quadrotor that follows it."""

    Config = QuadrotorConfig
    certified = True

    @staticmethod
    def build(config: QuadrotorConfig, mission: QuadrotorMission) -> tuple[Planner, Tracker]:
        bound = tracking_bound(config.tracker, mission.vehicle, mission.flight)
        tracker = GeometricTracker(mission.control_period, config.tracker, mission.vehicle, bound)
        return planner(config.flight, mission.flight, bound), tracker
