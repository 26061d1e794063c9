"""The receding-horizon planner (thesis A.3, A.4): optimise, append the manoeuvre, complete to rest on the target.

Each answer is a whole plan. Its start is read from the plan being flown, one period ahead, not from the estimate: between
the two stands the tracker, which keeps the vehicle within a bound of the plan. Near the target the planner commits: it asks
for an exact arrival at a node, and keeps that arrival time in the plans that follow.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from controllers.flight.certificate import Certificate, pass_time
from controllers.flight.completion import ArcList, complete
from controllers.flight.cost_to_go import FactoredCost
from controllers.flight.problem import Landscape, Parameters, Problem, Solution
from models.aerial.dynamics import input_at, state_at
from models.terrain.visibility import Radar
from sim.signals import Array, Message, Phase, Plan, PlanRequest, Status

_COMMIT_SPEED = 100.0  # [m/s] least mean speed assumed over the last arcs
_COMMIT_TRIES = 3
_SAME_TIME = 1e-9  # [s]


class Solver(Protocol):
    """What solves a Problem."""

    def solve(self, problem: Problem, guess: Array) -> Solution | str:
        """A solution, or the reason why there is none."""
        ...


class RecedingHorizon:
    """Plans by optimisation over a horizon of ``parameters.arcs`` arcs.

    ``cost_to_go(radars)`` builds the terminal cost for the threats known so far; a message with the topic "radar" and a
    ``Radar`` as payload adds one.
    """

    def __init__(
        self,
        parameters: Parameters,
        certificate: Certificate,
        solver: Solver,
        cost_to_go: Callable[[tuple[Radar, ...]], FactoredCost],
        radars: Sequence[Radar],
        period: float,
    ) -> None:
        self.period = period
        self._parameters, self._certificate, self._solver = parameters, certificate, solver
        self._cost_to_go, self._radars = cost_to_go, tuple(radars)
        self._landscape = Landscape.build(certificate.terrain, cost_to_go(self._radars))

    def plan(self, request: PlanRequest) -> Plan:
        self._listen(request.messages)
        current = request.current
        start = request.estimate.x if current is None else state_at(current, request.t_start)
        if current is not None:
            arrival = pass_time(current, self._certificate.target, request.t_start)
            if arrival - request.t_start < 1.5 * self._parameters.h:
                return _tail(current, request.t_start)  # too close for another choice
        began = time.thread_time()
        committed, reason = self._committed(request, start)
        if committed is not None:
            return dataclasses.replace(committed, solve_ms=1e3 * (time.thread_time() - began))
        problem = Problem(self._parameters, self._landscape, start, self._parameters.arcs)
        solution = self._solver.solve(problem, self._guess(current, request.t_start, problem))
        solve_ms = 1e3 * (time.thread_time() - began)
        if isinstance(solution, str):
            return Plan.failure(Status.SOLVER_FAILED, "; ".join(filter(None, (reason, solution))), solve_ms=solve_ms)
        plan = self._assembled(problem, solution, request.t_start, solve_ms)
        return (
            plan
            if solution.converged
            else dataclasses.replace(plan, notes=("iteration-limit",), message=solution.message)
        )

    def _listen(self, messages: Sequence[Message]) -> None:
        heard = tuple(m.payload for m in messages if m.topic == "radar" and isinstance(m.payload, Radar))
        if heard:
            self._radars += heard
            self._landscape = dataclasses.replace(self._landscape, cost=self._cost_to_go(self._radars))

    def _committed(self, request: PlanRequest, start: Array) -> tuple[Plan | None, str]:
        """A certified plan that arrives exactly at a node within the horizon, if there is one."""
        target, h, arcs = self._certificate.target, self._parameters.h, self._parameters.arcs
        current, reason = request.current, ""
        durations: list[float] = []
        if current is not None:
            left = pass_time(current, target, request.t_start) - request.t_start
            if left <= arcs * h + _SAME_TIME:
                durations.append(left)
        if not durations:
            speed = max(float(np.linalg.norm(start[3:])), _COMMIT_SPEED)
            first = max(2, math.ceil(float(np.linalg.norm(target - start[:3])) / (h * speed)))
            durations = [n * h for n in range(first, min(first + _COMMIT_TRIES, arcs + 1))]
        for duration in durations:
            count = max(1, round(duration / h))
            step = duration / count
            # A step that differs from h by rounding only shares the stencil of h.
            step = h if abs(step - h) < 1e-6 else step
            parameters = dataclasses.replace(self._parameters, h=step)
            problem = Problem(parameters, self._landscape, start, count, hold=target)
            solution = self._solver.solve(problem, self._guess(current, request.t_start, problem))
            if isinstance(solution, str):
                reason = f"arrival in {duration:.1f} s: {solution}"
                continue
            plan = self._assembled(problem, solution, request.t_start, 0.0)
            refusal = self._certificate.refuse(plan)
            if refusal is None:
                return plan, ""
            reason = f"arrival in {duration:.1f} s: {refusal.message}"
        return None, reason

    def _guess(self, current: Plan | None, t_start: float, problem: Problem) -> Array:
        """The optimised part of the plan being flown, shifted, with nothing after its end."""
        n, h = problem.arcs, problem.parameters.h
        guess = np.zeros(3 * n + 1)
        if current is None:
            return guess
        for j in range(n):
            middle = t_start + (j + 0.5) * h
            k = int(np.searchsorted(current.t, middle, side="right")) - 1
            if k >= len(current.u) or current.phase[k] != Phase.OPTIMISED:
                break
            guess[3 * j : 3 * j + 3] = input_at(current, middle)
        return guess

    def _assembled(self, problem: Problem, solution: Solution, t_start: float, solve_ms: float) -> Plan:
        """Optimised arcs, manoeuvre and completion as one plan."""
        parameters, target = problem.parameters, self._certificate.target
        arcs = ArcList.begin(t_start, problem.start)
        for a in solution.accelerations:
            arcs.add(a, parameters.h, Phase.OPTIMISED)
        if problem.hold is not None:
            arcs.x[-1] = np.concatenate([problem.hold, arcs.x[-1][3:]])  # within the solver's tolerance
        end = arcs.x[-1]
        braking = (np.array([0.0, 0.0, solution.climb]) - end[3:]) / parameters.manoeuvre_duration
        arcs.add(braking, parameters.manoeuvre_duration, Phase.MANOEUVRE)
        arcs.x[-1] = np.concatenate([arcs.x[-1][:3], [0.0, 0.0, solution.climb]])
        complete_by(arcs, self._certificate)
        effort = float(parameters.h * (solution.accelerations**2).sum())
        togo = 0.0 if problem.hold is not None else parameters.psi_per_metre * float(self._landscape.cost(end[:3])[0])
        return arcs.plan(effort + parameters.h * parameters.beta * problem.arcs + togo, solve_ms)


class Retreat:
    """Stops at once by a manoeuvre into hover, and completes from there: the plan where there is no other."""

    def __init__(self, certificate: Certificate, period: float) -> None:
        self.period = period
        self._certificate = certificate

    def plan(self, request: PlanRequest) -> Plan:
        start = request.estimate.x if request.current is None else state_at(request.current, request.t_start)
        arcs = ArcList.begin(request.t_start, start)
        speed = float(np.linalg.norm(start[3:]))
        if speed > 0.0:
            duration = speed / self._certificate.acceleration_max
            arcs.add(-start[3:] / duration, duration, Phase.MANOEUVRE)
            arcs.rest()
        complete_by(arcs, self._certificate)
        return arcs.plan(math.nan, math.nan)


def complete_by(arcs: ArcList, certificate: Certificate) -> None:
    """Complete within the bounds that the certificate allows."""
    complete(
        arcs,
        certificate.terrain,
        certificate.target,
        certificate.clearance_min,
        certificate.speed_max,
        certificate.acceleration_max,
    )


def _tail(plan: Plan, t_start: float) -> Plan:
    """The rest of a plan from ``t_start`` on, itself a plan."""
    k = max(0, int(np.searchsorted(plan.t, t_start + _SAME_TIME, side="right")) - 1)
    if k >= len(plan.u):
        return Plan.failure(Status.INFEASIBLE, "the plan being flown has come to its end")
    t, x = plan.t[k:].copy(), plan.x[k:].copy()
    t[0], x[0] = t_start, state_at(plan, t_start)
    return dataclasses.replace(plan, t=t, x=x, u=plan.u[k:], phase=plan.phase[k:], solve_ms=math.nan, notes=())
