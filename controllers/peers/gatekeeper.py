"""The plug-in ``gatekeeper``, a peer: D. R. Agrawal, R. Chen, D. Panagou, arXiv 2211.14361.

At each planning instant the nominal planner proposes a trajectory over its horizon T_H. For a switching time T_S the
candidate is

    the nominal trajectory on [0, T_S],   then the backup manoeuvre into the backup set, where the vehicle stays.

The candidate of the greatest valid T_S is committed, T_S = max {T_S in [0, T_H] : the candidate is safe for ever}. If
none is valid, or the nominal planner has no answer, the trajectory committed before continues.

Our interpretation: the nominal planner is the receding horizon of ``flight``, of which the optimised arcs are used and
the way behind them is not; the backup manoeuvre is a stop at the acceleration bound into a climb, and the backup set
is hover; a candidate is valid by the same certificate over the same ground, raised by the same tracking bound.
"""

from __future__ import annotations

import dataclasses
import math
import time

import numpy as np

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.plugin import FlightConfig, planner
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.controllers.peers.commitment import first_part, hovering, optimised_arcs, refusal, stop_and_climb
from mathnavi.interfaces.bounds import NonNegative, Positive, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Plan, PlanRequest
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightStatus

_MOST = 1000  # switching times that are tried


@configuration
class GatekeeperConfig(FlightConfig):
    """Fields of ``--planner``."""

    switching_step: Positive = 0.5
    """time between two switching times that are tried [s]"""
    climb: NonNegative = 100.0
    """climb rate at the end of the backup manoeuvre [m/s]; the speed at its start if that is less"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.duration > _MOST * self.switching_step:
            raise FieldError(
                f"switching_step = {self.switching_step!r}; allowed: >= {self.duration / _MOST:g} s, a horizon of "
                f"{self.duration:g} s by {_MOST}"
            )


class GatekeeperFlight:
    """Gatekeeper, a peer: the nominal plan for as long as a backup manoeuvre behind it is safe."""

    Config = GatekeeperConfig
    certifier = None  # it has its own rule

    @staticmethod
    def build(config: GatekeeperConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        """Return the planner of a mission, and the tracker of its plans."""
        bound = tracking_bound(config.bandwidth, mission)
        tracker = CriticallyDamped(mission.control_period, config.bandwidth, bound)
        certificate = Certificate.for_mission(mission, bound, tracker.held)
        return Gatekeeper(config, planner(config, mission, bound), certificate), tracker


class Gatekeeper:
    """Search for the greatest switching time from a nominal planner's trajectory to the backup manoeuvre."""

    def __init__(self, config: GatekeeperConfig, nominal: Planner, certificate: Certificate) -> None:
        self.period = nominal.period
        self._config, self._nominal, self._certificate = config, nominal, certificate

    def plan(self, request: PlanRequest) -> Plan:
        """The committed trajectory of the greatest valid switching time; a failure where none is valid."""
        began = time.thread_time()
        self._certificate = self._certificate.updated_with(request.messages)
        nominal = self._nominal.plan(request)
        if not nominal.ok:
            return nominal
        plan = self._committed(nominal)
        return dataclasses.replace(plan, solve_ms=1e3 * (time.thread_time() - began))

    def _committed(self, nominal: Plan) -> Plan:
        arcs = optimised_arcs(nominal)
        horizon = float(nominal.t[arcs]) - nominal.t_start
        steps = math.ceil(horizon / self._config.switching_step)
        message = ""
        for switching_time in np.linspace(horizon, 0.0, steps + 1):
            candidate = self._candidate(nominal, arcs, float(switching_time))
            refused = refusal(self._certificate, candidate)
            if refused is None:
                return candidate
            message = message or refused.message
        return Plan.failure(FlightStatus.LOW_CLEARANCE, f"no switching time is valid; the last one: {message}")

    def _candidate(self, nominal: Plan, arcs: int, switching_time: float) -> Plan:
        begun = first_part(nominal, arcs, switching_time)
        stop_and_climb(begun, self._certificate.acceleration_max, self._config.climb)
        return hovering(begun, self.period)
