"""The receding-horizon planner (thesis A.3, A.4): optimise, append the manoeuvre, complete to rest on the target.

Each answer is a whole plan. Its start is read from the plan being flown, one period ahead, not from the estimate:
between the two stands the tracker, which keeps the vehicle within a bound of the plan. Near the target the planner
commits: it requires an exact arrival at a node, and keeps that arrival time in the plans that follow.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from itertools import takewhile
from typing import Literal, Protocol

import numpy as np

from mathnavi.controllers.flight.certificate import Certificate, pass_time, remainder
from mathnavi.controllers.flight.completion import ArcList, complete
from mathnavi.controllers.flight.cost_to_go import FactoredCost
from mathnavi.controllers.flight.problem import (
    LengthToGo,
    Parameters,
    PlanningEnvironment,
    PlanSolution,
    Problem,
    proportional,
)
from mathnavi.interfaces.signals import Array, Message, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.knowledge import Knowledge
from mathnavi.models.aerial.plan_distance import clear
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from mathnavi.models.tolerances import TIME_TOLERANCE

_COMMIT_SPEED = 100.0  # [m/s] least mean speed assumed over the last arcs
_COMMIT_TRIES = 3
_ON_TIME = 0.1  # [s] by which a plan may miss (A.13)
_NEAR = 1.25  # arrival radii within which it does
ARRIVAL = "arrival time"  # the topic of messages that ask for one
ASSURED = "assured arrival time"  # the topic of messages that say when every stored plan arrives

Incorporation = Literal["schedule", "constraint", "penalty"]


class Solver(Protocol):
    """Solver of a ``Problem``."""

    def solve(self, problem: Problem, guess: Array) -> PlanSolution | str:
        """Solve from a guess (3n + 1,) of the unknowns [m/s^2, m/s]; returns the reason if it fails."""
        ...


class RecedingHorizon:
    """Planner by optimisation over the grid ``parameters.lengths``, every ``period`` [s].

    ``cost_to_go(knowledge)`` builds the terminal cost, and again when a message changes what is known
    (``mathnavi.models.aerial.knowledge``). A message with the topic "arrival time" and a time t_a [s] as payload
    requests an arrival at t_a, by ``incorporation`` (A.8.3). With L = Psi / psi the length to go and tau = t_a - t_1
    what is left:

        schedule     L(p_N) = L(p_1) (1 - T_p / tau), in the place of Psi as a cost and of S_eps;
        constraint   (A.13), T_p + L(p_N) / v_max = tau, also in their place, and a plan that misses it is a failure;
        penalty      ``arrival_weight`` (T_p + L(p_N) / v_max - tau)^2 in addition to Psi.

    Within reach of the horizon each is an exact arrival at t_a.

    A message with the topic "assured arrival time" and a time T_A as payload requires more: every plan that does not
    arrive exactly within its horizon waits on its completion path so as to arrive at T_A, and a plan that cannot is a
    failure. So the last plan to be adopted arrives at T_A, or before at the node that it committed to. The requirement
    ends when a message changes the target or the map.
    """

    def __init__(
        self,
        parameters: Parameters,
        certificate: Certificate,
        solver: Solver,
        cost_to_go: Callable[[Knowledge], FactoredCost],
        knowledge: Knowledge,
        period: float,
        incorporation: Incorporation = "schedule",
        arrival_weight: float = math.nan,
    ) -> None:
        self.period = period
        self._incorporation: Incorporation = incorporation
        self._arrival_weight = arrival_weight
        self._parameters, self._certificate, self._solver = parameters, certificate, solver
        self._cost_to_go, self._knowledge = cost_to_go, knowledge
        self._environment = PlanningEnvironment.build(certificate.terrain, cost_to_go(knowledge))
        self._arrival: float | None = None  # [s] requested
        self._assured: float | None = None  # [s] T_A, at which stored plans arrive
        shorter = [self._over(parameters.lengths[:k]) for k in range(1, parameters.arcs + 1)]
        self._ends = np.array([part.horizon for part in shorter])  # (n,) [s] of the arcs
        for part in shorter:
            _ = part.matrices  # computed now rather than in flight

    def plan(self, request: PlanRequest) -> Plan:
        """Plan from the plan being flown, one period ahead; returns a failure with its reason if it finds no plan."""
        self._listen(request.messages)
        current = request.current
        start = request.estimate.x if current is None else state_at(current, request.t_start)
        arrival = math.inf if current is None else pass_time(current, self._certificate.target, request.t)
        if current is not None and arrival - request.t_start < 1.5 * self._parameters.h:
            if current.t_end <= request.t_start + TIME_TOLERANCE:
                return Plan.failure(Status.INFEASIBLE, "the plan being flown has come to its end")
            return remainder(current, request.t_start)  # too close for another choice
        committed, spent, reason = self._committed(request, start, arrival)
        if committed is not None:
            return committed
        asked = self._arrival is None or abs(arrival - self._arrival) <= TIME_TOLERANCE
        if self._within_reach(arrival - request.t_start) and asked:  # committed before: the plan being flown stays
            return Plan.failure(Status.INFEASIBLE, reason, solve_ms=spent)
        problem = Problem(
            self._parameters, self._environment, start, length_to_go=self._length_to_go(start, request.t_start)
        )
        solution, solve_ms = self._solved(problem, current, request.t_start, spent)
        if isinstance(solution, str):
            return Plan.failure(Status.SOLVER_FAILED, "; ".join(filter(None, (reason, solution))), solve_ms=solve_ms)
        if self._incorporation == "constraint" and abs(error := self._arrival_error(problem, solution)) > _ON_TIME:
            return Plan.failure(Status.INFEASIBLE, f"(A.13) is off by {error:.2f} s", solve_ms=solve_ms)
        plan = self._assembled(problem, solution, request.t_start, solve_ms)
        if not plan.ok or not (broken := self._breaks_assurance(plan, current is None)):
            return plan
        if current is not None and arrival < min(self._assured or 0.0, self._arrival or 0.0) - self._parameters.h:
            return stopping(self._certificate, request.t_start, start, self._stored_arrival())
        return Plan.failure(Status.INFEASIBLE, broken, solve_ms=solve_ms)

    def _breaks_assurance(self, plan: Plan, first: bool) -> str:
        """Reason why a plan that is stored whole does not arrive at T_A: later (but for a ``first`` one), or before."""
        if self._assured is None:
            return ""
        if not first and (late := plan.t_end - self._stored_end()) > 0.0:
            return f"arrives {late:.2f} s after the assured time of {self._assured:.2f} s"
        before = plan.t_end - 1.5 * braking_time(self._certificate)  # 2.25 radii away, if that is its descent
        if _passes(plan, self._certificate.target, _NEAR * self._certificate.arrival_radius, before):
            return f"passes the target before the assured time of {self._assured:.2f} s"
        return ""

    @property
    def parameters(self) -> Parameters:
        """Parameters of the problems that the planner solves."""
        return self._parameters

    @property
    def environment(self) -> PlanningEnvironment:
        """The ground and the terminal cost, with the threats known so far."""
        return self._environment

    def length_to_go(self, points: Array) -> Array:
        """Length (n,) [m] from points (n, 3) [m] to the target, around the ground and the threats known so far."""
        return self._environment.cost(points)

    def _solved(
        self, problem: Problem, current: Plan | None, t_start: float, spent: float
    ) -> tuple[PlanSolution | str, float]:
        """The solver's answer, and the thread CPU time [ms], with what was ``spent`` before."""
        began = time.thread_time()
        solution = self._solver.solve(problem, self._guess(current, t_start, problem))
        return solution, spent + 1e3 * (time.thread_time() - began)

    def _listen(self, messages: Sequence[Message]) -> None:
        if not messages:
            return
        known = self._knowledge.updated_with(messages)
        if known is not self._knowledge:
            certificate = self._certificate.updated_with(messages)
            cost = self._cost_to_go(known)
            if certificate.terrain is self._certificate.terrain:
                self._environment = dataclasses.replace(self._environment, cost=cost)
            else:
                self._environment = PlanningEnvironment.build(certificate.terrain, cost)
            if known.target != self._knowledge.target or known.terrain is not self._knowledge.terrain:
                self._assured = None
            self._knowledge, self._certificate = known, certificate
        for message in messages:
            if message.topic == ARRIVAL and isinstance(message.payload, float) and math.isfinite(message.payload):
                self._arrival = message.payload
            self._assured = _assured_by(message, self._assured)

    def _stored_arrival(self) -> float | None:
        """Time [s] at which a plan that stores its way to the target has to arrive; None if no time is requested."""
        asked = [t for t in (self._arrival, self._assured) if t is not None]
        return max(asked, default=None)

    def _stored_end(self) -> float:
        """Time [s] by which a plan that stores its way to the target has come to rest."""
        arrival = self._stored_arrival()
        return math.inf if arrival is None else arrival + braking_time(self._certificate) + TIME_TOLERANCE

    def _length_to_go(self, start: Array, t_start: float) -> LengthToGo | None:
        """Length to go that the plan should have at p_N; None if no arrival time is requested."""
        if self._arrival is None and self._assured is None:
            return None
        horizon, v_max = self._parameters.horizon, self._certificate.speed_max
        length = float(self._environment.cost(start[:3])[0])
        asked = self._arrival
        if asked is None and length < 2.0 * horizon * v_max:  # so near that it would be there too soon
            asked = self._assured
        if asked is None:
            return None
        left = max(asked - t_start, horizon)
        if self._incorporation == "schedule":
            return LengthToGo(length * (1.0 - horizon / left))
        by_speed = v_max * (left - horizon)
        if self._incorporation == "constraint":
            return LengthToGo(by_speed)
        return LengthToGo(by_speed, 2.0 * self._arrival_weight / v_max**2, instead=False)

    def _arrival_error(self, problem: Problem, solution: PlanSolution) -> float:
        """Time [s] by which a plan misses (A.13); 0 if no arrival time is requested."""
        if problem.length_to_go is None:
            return 0.0
        s = problem.matrices
        end = problem.start[:3] + s.base[-2] * problem.start[3:] + s.weights[-2] @ solution.accelerations
        return (float(self._environment.cost(end)[0]) - problem.length_to_go.length) / self._certificate.speed_max

    def _within_reach(self, duration: float) -> bool:
        """True if an arrival in ``duration`` [s] fits the horizon, lengthened by its first arc at most."""
        return duration <= self._parameters.horizon + self._parameters.h + TIME_TOLERANCE

    def _over(self, lengths: tuple[float, ...]) -> Parameters:
        """The parameters over a grid other than the horizon's."""
        return dataclasses.replace(self._parameters, lengths=lengths)

    def _grid(self, duration: float) -> tuple[float, ...]:
        """The first arcs, in the number nearest to ``duration`` [s], lengthened or shortened to last that long."""
        nearest = self._parameters.lengths[: int(np.abs(self._ends - duration).argmin()) + 1]
        fitting = proportional(nearest, duration)
        # Arcs that differ from the horizon's own by rounding only share their matrices.
        return nearest if np.allclose(fitting, nearest, rtol=0.0, atol=1e-6) else fitting

    def _committed(self, request: PlanRequest, start: Array, arrival: float) -> tuple[Plan | None, float, str]:
        """A certified plan that arrives exactly at a node within the horizon, or None; time spent [ms]; reason."""
        target = self._certificate.target
        current, reason, spent = request.current, "", 0.0
        for duration in self._durations(start, request.t_start, arrival):
            problem = Problem(self._over(self._grid(duration)), self._environment, start, terminal_position=target)
            solution, spent = self._solved(problem, current, request.t_start, spent)
            if isinstance(solution, str):
                reason = f"arrival in {duration:.1f} s: {solution}"
                continue
            plan = self._assembled(problem, solution, request.t_start, spent)
            refusal = self._certificate.check(plan) if plan.ok else plan
            if refusal is None and self._assured is not None and request.t_start + duration > self._assured - _ON_TIME:
                # The stored plan arrives then, and comes down fast; a slow approach is there too soon.
                before = self._parameters.h / 2.0
                if _passes(plan, target, self._certificate.arrival_radius, request.t_start + duration - before):
                    reason = f"arrival in {duration:.1f} s: within the arrival radius more than {before:.2f} s before"
                    continue
            if refusal is None:
                return plan, spent, ""
            reason = f"arrival in {duration:.1f} s: {refusal.message}"
        return None, spent, reason

    def _durations(self, start: Array, t_start: float, arrival: float) -> list[float]:
        """Durations [s] to try for an exact arrival: to the requested time or ``arrival``, then others within reach.

        That of ``arrival`` stands alone. None is before the requested time or after the assured one.
        """
        asked = self._assured if self._arrival is None else self._arrival
        left = (arrival if asked is None else asked) - t_start
        fixed = [left] if left > 0.0 and self._within_reach(left) else []
        if fixed and asked is None:
            return fixed
        h = self._parameters.h
        speed = max(float(np.linalg.norm(start[3:])), _COMMIT_SPEED)
        first = max(2, math.ceil(float(np.linalg.norm(self._certificate.target - start[:3])) / (h * speed)))
        # A little more than the horizon is within reach of slightly longer arcs. Beyond it the terminal cost
        # would have to shape the flight past the target, which it cannot.
        longest = math.inf if self._assured is None else self._assured - t_start + TIME_TOLERANCE
        tries = (n * h for n in range(first, first + _COMMIT_TRIES) if n * h <= longest)
        possible = [duration for duration in tries if self._within_reach(duration)]
        return fixed + [duration for duration in possible if asked is None or duration > left]

    def _guess(self, current: Plan | None, t_start: float, problem: Problem) -> Array:
        """The optimised part of the plan being flown, at the middle of each arc, with nothing after its end."""
        n = problem.arcs
        guess = np.zeros(3 * n + 1)
        if current is not None:
            middles = t_start + problem.matrices.middles
            arcs, phases = current.t.searchsorted(middles, side="right") - 1, current.phase.tolist()
            optimised = (k < len(phases) and phases[k] == FlightPhase.OPTIMISED for k in arcs.tolist())
            count = sum(1 for _ in takewhile(bool, optimised))
            guess[: 3 * count] = current.u[arcs[:count]].ravel()
        return guess

    def _assembled(self, problem: Problem, solution: PlanSolution, t_start: float, solve_ms: float) -> Plan:
        """Optimised arcs, manoeuvre and completion as one plan."""
        parameters = problem.parameters
        arcs = ArcList.begin(t_start, problem.start)
        for a, length in zip(_exact(problem, solution), parameters.lengths, strict=True):
            arcs.add(a, length, FlightPhase.OPTIMISED)
        end = arcs.x[-1]
        braking = (np.array([0.0, 0.0, solution.climb]) - end[3:]) / parameters.manoeuvre_duration
        arcs.add(braking, parameters.manoeuvre_duration, FlightPhase.MANOEUVRE)
        arcs.x[-1] = np.concatenate([arcs.x[-1][:3], [0.0, 0.0, solution.climb]])
        if not self._certificate.terrain.contains(*arcs.x[-1][:2]):
            message = f"the manoeuvre ends at {np.round(arcs.x[-1][:2]).tolist()} m"
            return Plan.failure(FlightStatus.OFF_MAP, message, solve_ms=solve_ms)
        exact = problem.terminal_position is not None
        complete_by(arcs, self._certificate, self._arrival if exact else self._stored_arrival())
        shares = np.array(parameters.lengths) / parameters.h  # exactly 1 on a uniform grid
        effort = float(parameters.h * (shares[:, None] * solution.accelerations**2).sum())
        togo = (
            0.0
            if problem.terminal_position is not None
            else parameters.psi_per_metre * float(self._environment.cost(end[:3])[0])
        )
        plan = arcs.plan(effort + parameters.h * parameters.beta * float(shares.sum()) + togo, solve_ms)
        if solution.converged:
            return plan
        return dataclasses.replace(plan, notes=("iteration-limit",), message=solution.message)


def _passes(plan: Plan, target: Array, distance: float, until: float) -> bool:
    """True if a plan is nearer than ``distance`` [m] to a target (3,) [m] before ``until`` [s], in any phase."""
    k = int(np.searchsorted(plan.t, until))
    if k < len(plan.t):
        x = np.vstack([plan.x[:k], state_at(plan, until)])
        plan = dataclasses.replace(plan, t=np.append(plan.t[:k], until), x=x, u=plan.u[:k], phase=plan.phase[:k])
    there = Plan(plan.t[:1], np.concatenate([target, np.zeros(3)])[None, :], np.empty((0, 3)), plan.phase[:0])
    return not clear(plan, there, distance, float(plan.t[0]))


def _exact(problem: Problem, solution: PlanSolution) -> Array:
    """The accelerations (n, 3), changed as little as can be so that an exact arrival is exact to rounding."""
    a = solution.accelerations
    if problem.terminal_position is None:
        return a
    s = problem.matrices
    c = s.weights[-2]  # p_N = p_1 + base v_1 + sum_j c_j a_j
    miss = problem.terminal_position - (problem.start[:3] + s.base[-2] * problem.start[3:] + c @ a)
    exact: Array = a + np.outer(c / (c @ c), miss)
    return exact


class StopAndHover:
    """Fallback planner: stops at once by a manoeuvre into hover, and completes from there."""

    def __init__(self, certificate: Certificate, period: float) -> None:
        self.period = period
        self._certificate = certificate
        self._assured: float | None = None  # [s] T_A, at which stored plans arrive

    def plan(self, request: PlanRequest) -> Plan:
        """Plan that stops at once and completes from hover; a failure where that leaves the map."""
        for message in request.messages:
            self._assured = _assured_by(message, self._assured)
        start = request.estimate.x if request.current is None else state_at(request.current, request.t_start)
        return stopping(self._certificate, request.t_start, start, self._assured)


def stopping(certificate: Certificate, t_start: float, start: Array, arrival: float | None = None) -> Plan:
    """The plan that stops at once, and completes so as to arrive at ``arrival`` [s] if given.

    ``start`` (6,) [m, m/s] is the state at ``t_start`` [s]. A failure where the vehicle stops off the map.
    """
    arcs = ArcList.begin(t_start, start)
    speed = float(np.linalg.norm(start[3:]))
    if speed > 0.0:
        duration = speed / certificate.acceleration_max
        arcs.add(-start[3:] / duration, duration, FlightPhase.MANOEUVRE)
        arcs.rest()
    if not certificate.terrain.contains(*arcs.x[-1][:2]):
        return Plan.failure(FlightStatus.OFF_MAP, f"the vehicle stops at {np.round(arcs.x[-1][:2]).tolist()} m")
    complete_by(arcs, certificate, arrival)
    return arcs.plan(math.nan, math.nan)


def _assured_by(message: Message, before: float | None) -> float | None:
    """Assured time T_A [s] after a message: the one it states, or the one ``before``."""
    sound = message.topic == ASSURED and isinstance(message.payload, float) and math.isfinite(message.payload)
    return message.payload if sound else before


def braking_time(certificate: Certificate) -> float:
    """Time [s] from the arrival radius to rest on the target."""
    return math.sqrt(2.0 * certificate.arrival_radius / certificate.acceleration_max)


def complete_by(arcs: ArcList, certificate: Certificate, arrival: float | None = None) -> None:
    """Complete within the bounds that the certificate allows, so as to arrive at ``arrival`` [s] but no sooner.

    To arrive is to come within the arrival radius, which a vehicle that brakes onto the target does before it rests. A
    vehicle with an assigned level waits on it, above the target; others wait where the manoeuvre has brought them.
    """
    levelled = math.isfinite(certificate.cruise_level)
    complete(
        arcs,
        certificate.terrain,
        certificate.target,
        certificate.clearance_min,
        certificate.speed_max,
        certificate.acceleration_max,
        -math.inf if arrival is None else arrival + braking_time(certificate),
        certificate.cruise_level,
        2.0 * certificate.arrival_radius if levelled else math.inf,
    )
