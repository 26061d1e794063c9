"""The plug-in ``faster``, a peer: J. Tordesillas, B. T. Lopez, M. Everett, J. P. How, arXiv 2001.04420.

At each planning instant two trajectories are computed:

    whole   from the committed trajectory towards the goal, over the horizon, without a stop at its end;
    safe    from a point R on the whole one to rest, within free space.

The whole trajectory up to R, and the safe one from there, are committed. If either is not found, the trajectory
committed before continues, whose safe part is the fallback. R is the last point of the whole trajectory from which the
vehicle can brake before the place H where it leaves free space, |v|^2 / (2 a_max) <= the distance to H; a whole
trajectory that stays in free space up to the target is committed up to its end, as in the authors' program.

Our interpretation: the whole trajectory is that of the receding horizon of ``flight``, of which the optimised arcs are
used; H is where these come closer to the ground than allowed, else their end. The safe trajectory is the one of least
effort among those to a lattice of places of rest, instead of a mixed-integer programme over polyhedra. Free space is
what the same certificate allows, over the same ground, raised by the same tracking bound.
"""

from __future__ import annotations

import dataclasses
import time
from itertools import product

import numpy as np

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.flight.plugin import FlightConfig, planner
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.controllers.peers.commitment import first_part, hovering, least_effort, optimised_arcs, refusal
from mathnavi.interfaces.bounds import NonNegative, Positive, configuration
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus

_SAMPLES = 40  # of a whole trajectory, among which R is
_ARCS = 6  # of a safe trajectory
_SLOWER = (1.02, 1.4, 2.0)  # durations of a safe trajectory over that of the hardest stop
_UP, _ASIDE = (0.0, 0.35, 0.7), (0.0, -0.5, 0.5)  # places of rest next to that of a straight stop, over its length


@configuration
class FasterConfig(FlightConfig):
    """Fields of ``--planner``."""

    margin: NonNegative = 50.0
    """clearance that the whole trajectory keeps above h_min, softly [m]"""
    braking: Positive = 2.0
    """ratio of the way that is left before H to the least stopping distance"""


class FasterFlight:
    """FASTER's rule, a peer: a whole and a safe trajectory, the safe one always as fallback."""

    Config = FasterConfig
    certifier = None  # it has its own rule

    @staticmethod
    def build(config: FasterConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        """Return the planner of a mission, and the tracker of its plans."""
        bound = tracking_bound(config.bandwidth, mission)
        tracker = CriticallyDamped(mission.control_period, config.bandwidth, bound)
        certificate = Certificate.for_mission(mission, bound, tracker.held)
        return Faster(config, planner(config, mission, bound), certificate), tracker


class Faster:
    """Planner that commits to a whole trajectory up to R and to a safe one from there on."""

    def __init__(self, config: FasterConfig, whole: Planner, certificate: Certificate) -> None:
        self.period = whole.period
        self._config, self._whole, self._certificate = config, whole, certificate

    def plan(self, request: PlanRequest) -> Plan:
        """The committed trajectory; a failure where the whole or the safe one is not found."""
        began = time.thread_time()
        self._certificate = self._certificate.updated_with(request.messages)
        whole = self._whole.plan(request)
        if not whole.ok:
            return whole
        plan = self._committed(whole)
        return dataclasses.replace(plan, solve_ms=1e3 * (time.thread_time() - began))

    def _committed(self, whole: Plan) -> Plan:
        arcs = optimised_arcs(whole)
        begun = first_part(whole, arcs, self._until_r(whole, arcs))
        message = ""
        for accelerations, duration in self._safe(begun.x[-1]):
            committed = self._joined(begun, accelerations, duration)
            refused = refusal(self._certificate, committed)
            if refused is None:
                return committed
            message = message or refused.message
        return Plan.failure(FlightStatus.LOW_CLEARANCE, f"no safe trajectory: {message}")

    def _until_r(self, whole: Plan, arcs: int) -> float:
        """Time [s] from the start of the whole trajectory to R; 0 if the vehicle has to stop at once."""
        if arcs == 0:
            return 0.0
        certificate = self._certificate
        t = np.linspace(whole.t_start, float(whole.t[arcs]), _SAMPLES)
        x = state_at(whole, t)
        duration = np.diff(t)
        u = np.diff(x[:, 3:], axis=0) / duration[:, None]
        clearance = certificate.terrain.path_clearance(x[:-1, :3], x[:-1, 3:], u, duration)
        leaves = np.flatnonzero(clearance < certificate.clearance_min)
        h = int(leaves[0]) if len(leaves) else len(t) - 1
        if not len(leaves) and np.linalg.norm(x[-1, :3] - certificate.target) <= certificate.arrival_radius:
            return float(t[-1] - whole.t_start)  # all the way to the target is free
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(x[:, :3], axis=0), axis=1))])
        stop = (x[:, 3:] ** 2).sum(axis=1) / (2.0 * certificate.acceleration_max)
        near = np.flatnonzero(way[h] - way[: h + 1] >= self._config.braking * stop[: h + 1])
        return float(t[near[-1]] - whole.t_start) if len(near) else 0.0

    def _safe(self, start: Array) -> list[tuple[Array, float]]:
        """Accelerations (arcs, 3) [m/s^2] and durations [s] from a state (6,) to rest, by their effort."""
        velocity, bound = start[3:], self._certificate.acceleration_max
        speed = float(np.linalg.norm(velocity))
        if speed == 0.0:
            return [(np.zeros((_ARCS, 3)), self.period)]
        aside = np.array([-velocity[1], velocity[0], 0.0]) / speed
        found = []
        for slower, up, side in product(_SLOWER, _UP, _ASIDE):
            duration = slower * speed / bound
            length = 0.5 * speed * duration
            rest = start[:3] + 0.5 * duration * velocity + length * (up * np.array([0.0, 0.0, 1.0]) + side * aside)
            a = least_effort(start, np.array([*rest, 0.0, 0.0, 0.0]), _ARCS, duration)
            if float(np.linalg.norm(a, axis=1).max()) <= bound:
                found.append((a, duration))
        return sorted(found, key=lambda each: float((each[0] ** 2).sum()) * each[1])

    def _joined(self, begun: ArcList, accelerations: Array, duration: float) -> Plan:
        arcs = ArcList(list(begun.t), list(begun.x), list(begun.u), list(begun.phase))
        for a in accelerations:
            arcs.add(a, duration / len(accelerations), FlightPhase.MANOEUVRE)
        arcs.rest()
        return hovering(arcs, self.period)
