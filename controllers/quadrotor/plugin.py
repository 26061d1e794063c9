"""The plug-in ``quadrotor``: the unchanged flight planner, and beneath it a tracker that moves four rotors.

The two time scales of Fig. A.9: the planner moves a double integrator every half second, the tracker the quadrotor
many times in between. What the tracker keeps enters the planner's certificate as its tracking bound. The planner works
on the mission magnified to its own scale (``similarity``), so its fields are those of the controller ``flight``, in its
units. One of them has another default: near the walls of a canyon, cliffs at the planner's scale, plans with a
``margin`` of 25 m are often not certified.
"""

from __future__ import annotations

from typing import ClassVar

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.plugin import RecedingHorizonConfig, planner
from mathnavi.controllers.quadrotor.bound import tracking_bound
from mathnavi.controllers.quadrotor.similarity import Similarity, SimilarPlanner
from mathnavi.controllers.quadrotor.tracker import GeometricTracker, TrackerConfig
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.models.quadrotor.mission import QuadrotorMission


@configuration
class QuadrotorConfig:
    """Fields of ``--planner``."""

    kernels: ClassVar[str] = "mathnavi.controllers.quadrotor.kernels"  # compiled before the first run

    flight: RecedingHorizonConfig = RecedingHorizonConfig(margin=100.0)
    """Fields of the planner, on the magnified mission: v_max is 300 m/s there, its times are 10/3 of the true ones."""
    tracker: TrackerConfig = TrackerConfig()


class QuadrotorFlight:
    """Receding horizon over a double integrator, certified for the quadrotor that follows it."""

    Config = QuadrotorConfig

    @staticmethod
    def build(config: QuadrotorConfig, mission: QuadrotorMission) -> tuple[Planner, Tracker]:
        """Build planner and tracker of one vehicle."""
        bound = tracking_bound(config.tracker, mission.vehicle, mission.flight)
        Certificate.for_mission(
            mission.flight, bound
        )  # what leaves nothing to fly with is refused in the mission's own units
        tracker = GeometricTracker(mission.control_period, config.tracker, mission.vehicle, bound)
        similarity = Similarity.for_mission(mission.flight)
        magnified = planner(config.flight, similarity.mission(mission.flight), similarity.bound(bound))
        return SimilarPlanner(magnified, similarity), tracker
