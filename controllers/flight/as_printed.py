"""The plug-in ``as_printed``: the planner of the thesis as printed, for comparison. It carries no certificate.

At each step the NLP (A.2), in its form (A.3), over the accelerations a_1 ... a_N:

    minimise  sum_{i=1}^{N-1} h (|a_i|^2 + beta) + Psi(p_N)
    subject to  p_{i+1} = p_i + h v_i,  v_{i+1} = v_i + h a_i          forward Euler, i = 1 ... N - 1
                d(p_i) = H(x_i, y_i) + h_min - z_i <= 0                at the nodes only (Definition A.2), i = 1 ... N
                |v_i|_inf <= v_max,  |a_i|_inf <= a_max                i = 1 ... N (v_1 is given)
                p_1 = p_c,  v_1 = v_c                                  the measured state, at the time of the hand-over
                h (|a_N|^2 + beta) + Psi(p_N + h v_N) - Psi(p_N) <= -epsilon,     a_N in S_epsilon (Definition A.1)

H is the terrain's triangles; Psi is trilinear on the 33 x 33 x 5 grid (A.5), beta / v_c per metre. a_N stands in
S_epsilon alone, where nothing is better than a_N = 0. It is followed by the manoeuvre of (A.4), which is predetermined,
not optimised:

    (p^_1, v^_1) = (p_N + h v_N, v_N + h a_N),  N_bar nodes by forward Euler under one constant acceleration,

which stops the level motion and pulls up as far as the bounds allow, into S_s (Definition A.3): e_z'v >= |v|
sin(alpha_bar), alpha_bar the terrain's steepest slope. It is verified at its nodes once the NLP is solved. If the
NLP fails or the manoeuvre is infeasible, the previous concatenated solution goes on (Remark A.5). From S_s the
vehicle completes the task "continuing upward and upon a full turn above the target" (A.4).

Where the thesis is silent: the accelerations are flown, each held for h, so the arcs of a plan are the exact motion;
only the optimiser uses Euler. The vehicle's force is bounded in the Euclidean norm, so the thesis's box for a_i is the
largest one in that ball. S_f is p = p_f, and no node is constrained to it: the vehicle arrives if it happens to pass
within the radius, else by completion.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated

import daqp
import numpy as np
from annotated_types import Interval

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.completion import ArcList, complete
from mathnavi.controllers.flight.cost_to_go import REFERENCE_SPEED, TrilinearCost, trilinear_cost
from mathnavi.controllers.flight.plugin import GridLayers, GridNodes
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.interfaces.bounds import Positive, Within, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import flow, input_at, state_at
from mathnavi.models.aerial.knowledge import Knowledge
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from mathnavi.models.terrain.height_field import HeightField

_FEASIBLE = 1e-3  # [m, m/s] violation of a constraint that counts as none
_GAIN = 1e-7  # of 1 + cost: a step that promises less is the last
_LARGEST, _SMALLEST = 40.0, 1e-5  # [m/s^2] of the trust region
_ITERATIONS = 60
_UNBOUNDED = 1e30


@configuration
class AsPrintedConfig:
    """Fields of ``--planner``."""

    nodes: Annotated[int, Within(Interval(ge=3, le=121), allowed="3 to 121")] = 13
    """number N of nodes of the horizon"""  # by Euler, a_1 moves p_3 first
    horizon: Positive | None = None
    """length T_p of the horizon [s]; (nodes - 1) 5/3 if not given"""
    beta: Positive = 100.0
    """cost of a second against a squared acceleration [m^2/s^4]"""
    epsilon: Positive = 0.01
    """least gain of a step (Definition A.1), as a fraction of h beta"""
    grid_nodes: GridNodes = 33
    """number of nodes of the cost-to-go's grid along the longer side of the map"""
    grid_layers: GridLayers = 5
    """number of layers of the cost-to-go's grid"""
    bandwidth: Positive = 0.8
    """bandwidth of the tracker [rad/s]"""

    @property
    def h(self) -> float:
        """Sampling interval [s]."""
        horizon = self.horizon if self.horizon is not None else (self.nodes - 1) * 5.0 / 3.0
        return horizon / (self.nodes - 1)


class AsPrintedFlight:
    """The planner of the thesis as printed, for comparison; it carries no certificate."""

    Config = AsPrintedConfig
    certifier = None  # its plans are flown as printed, without a certificate

    @staticmethod
    def build(config: AsPrintedConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        """Return the planner of a mission, and the tracker of its plans."""
        bound = tracking_bound(config.bandwidth, mission)
        if bound.feedback >= mission.acceleration_max:
            raise MissionError(
                f"acceleration_max = {mission.acceleration_max:g} leaves nothing to plan with; allowed: > "
                f"{bound.feedback:.3g}, which noise and gusts take"
            )
        return AsPrinted(config, mission, bound), CriticallyDamped(mission.control_period, config.bandwidth, bound)


@dataclass(frozen=True, eq=False)
class EulerNlp:
    """Problem (A.2) from one state: nodes, objective and constraints as functions of a = (a_1, ..., a_{N-1})."""

    terrain: HeightField
    cost: TrilinearCost
    start: Array  # (6,) p_c [m], v_c [m/s]
    nodes: int  # N
    h: float  # [s]
    beta: float  # [m^2/s^4]
    epsilon: float  # cost
    clearance: float  # [m] h_min
    speed: float  # [m/s] v_max
    thrust: float  # [m/s^2] a_max

    @property
    def psi_per_metre(self) -> float:
        """Terminal cost of one metre to go."""
        return self.beta / REFERENCE_SPEED

    def states(self, a: Array) -> tuple[Array, Array]:
        """Nodes p (N, 3) [m], v (N, 3) [m/s] by forward Euler under a (N - 1, 3) [m/s^2]."""
        v = self.start[3:] + self.h * np.vstack([np.zeros(3), np.cumsum(a, axis=0)])
        p = self.start[:3] + self.h * np.vstack([np.zeros(3), np.cumsum(v[:-1], axis=0)])
        return p, v

    def objective(self, a: Array) -> float:
        """Objective of (A.2) at the unknowns a (3 (N - 1),) [m/s^2]."""
        p, _ = self.states(a)
        effort = float((a * a).sum()) + self.beta * (self.nodes - 1)
        return self.h * effort + self.psi_per_metre * float(self.cost(p[-1:])[0])

    def gradient(self, a: Array) -> Array:
        """Gradient (3 (N - 1),) of the objective at the unknowns a (3 (N - 1),) [m/s^2]."""
        p, _ = self.states(a)
        slope = self.psi_per_metre * self.cost.gradient(p[-1:])[0]
        gradient: Array = 2.0 * self.h * a + position_weights(self.nodes, self.h)[-1][:, None] * slope
        return gradient.ravel()

    def constraints(self, a: Array) -> Array:
        """G(a) <= 0: d(p_i) [m], |v_i| - v_max [m/s] axis by axis up and down, and S_epsilon over beta / v_c [m]."""
        p, v = self.states(a)
        ahead = p[-1] + self.h * v[-1]
        there, here = self.cost(np.vstack([ahead, p[-1]]))
        approach = there - here + (self.h * self.beta + self.epsilon) / self.psi_per_metre
        return np.concatenate(
            [self.depth(p), (v[1:] - self.speed).ravel(), (-v[1:] - self.speed).ravel(), np.array([approach])]
        )

    def depth(self, p: Array) -> Array:
        """d(p) (n,) [m] of points (n, 3); beyond the border the ground keeps its height there."""
        depth: Array = self.terrain.height(*self._held(p)) + self.clearance - p[:, 2]
        return depth

    def jacobian(self, a: Array) -> Array:
        """dG/da (m, 3 (N - 1)), a row for each of the m constraints, at the unknowns a (3 (N - 1),) [m/s^2]."""
        p, v = self.states(a)
        n = self.nodes
        position, velocity = position_weights(n, self.h), velocity_weights(n, self.h)
        slope = np.column_stack([self.terrain.gradient(*self._held(p)), np.full(n, -1.0)])
        depth = (position[:, :, None] * slope[:, None, :]).reshape(n, -1)
        speed = np.kron(velocity[1:], np.eye(3))
        there, here = self.cost.gradient(np.vstack([p[-1] + self.h * v[-1], p[-1]]))
        beyond = position[-1] + self.h * velocity[-1]
        approach = (beyond[:, None] * there - position[-1][:, None] * here).ravel()
        return np.vstack([depth, speed, -speed, approach])

    def _held(self, p: Array) -> tuple[Array, Array]:
        return np.clip(p[:, 0], 0.0, self.terrain.width), np.clip(p[:, 1], 0.0, self.terrain.depth)


@lru_cache(maxsize=16)
def velocity_weights(nodes: int, h: float) -> Array:
    """Weights (N, N - 1) [s] of v_i = v_1 + sum_j weights_ij a_j."""
    i, j = np.arange(nodes)[:, None], np.arange(nodes - 1)[None, :]
    return np.where(j < i, h, 0.0)


@lru_cache(maxsize=16)
def position_weights(nodes: int, h: float) -> Array:
    """Weights (N, N - 1) [s^2] of p_i = p_1 + (i - 1) h v_1 + sum_j weights_ij a_j."""
    i, j = np.arange(nodes)[:, None], np.arange(nodes - 1)[None, :]
    weights: Array = h * h * np.maximum(0.0, i - 1.0 - j)
    return weights


def solve(nlp: EulerNlp, guess: Array) -> tuple[Array, Status]:
    """Sequential quadratic programming on (A.3) from ``guess`` (N - 1, 3) [m/s^2], in a trust region.

    The merit is the objective plus rho max(0, G), an exact penalty where rho exceeds the sum of the multipliers.
    Each step solves the convex programme min g'd + h |d|^2 + rho t, G + G'd <= t, t >= 0, within the box for a and
    the trust region. ``INFEASIBLE`` if it comes to a standstill where a constraint is violated, ``SOLVER_FAILED``
    at the iteration limit.
    """
    size = guess.size
    rho = 1e3 * (1.0 + nlp.psi_per_metre)
    hessian = np.diag(np.append(np.full(size, 2.0 * nlp.h), 1e-6))
    a = np.clip(guess, -nlp.thrust, nlp.thrust)
    value, values = nlp.objective(a), nlp.constraints(a)
    gradient, jacobian, excess = nlp.gradient(a), nlp.jacobian(a), _excess(values)
    radius = _LARGEST
    for _ in range(_ITERATIONS):
        rows = np.hstack([jacobian, np.full((len(values), 1), -1.0)])
        flat = a.ravel()
        upper = np.concatenate([np.minimum(radius, nlp.thrust - flat), [_UNBOUNDED], -values])
        lower = np.concatenate([np.maximum(-radius, -nlp.thrust - flat), [0.0], np.full(len(values), -_UNBOUNDED)])
        sense = np.zeros(size + 1 + len(values), np.int32)
        solution, _, flag, _ = daqp.solve(hessian, np.append(gradient, rho), rows, upper, lower, sense)
        if flag <= 0:
            return a, Status.SOLVER_FAILED
        step, slack = np.array(solution[:-1]), max(0.0, float(solution[-1]))
        promised = rho * (excess - slack) - float(gradient @ step) - nlp.h * float(step @ step)
        if promised <= _GAIN * (1.0 + abs(value)) or radius < _SMALLEST:
            return a, Status.OK if excess <= _FEASIBLE else Status.INFEASIBLE
        trial = np.clip(a + step.reshape(a.shape), -nlp.thrust, nlp.thrust)
        trial_value, trial_values = nlp.objective(trial), nlp.constraints(trial)
        trial_excess = _excess(trial_values)
        gain = value - trial_value + rho * (excess - trial_excess)
        reached = float(np.abs(step).max())
        if gain > 0.1 * promised:
            a, value, values, excess = trial, trial_value, trial_values, trial_excess
            gradient, jacobian = nlp.gradient(a), nlp.jacobian(a)
            radius = min(2.0 * radius, _LARGEST) if gain > 0.7 * promised else radius
        else:
            radius = 0.3 * reached
    return a, Status.SOLVER_FAILED


def _excess(values: Array) -> float:
    return max(0.0, float(values.max()))


class AsPrinted:
    """The thesis' planner of A.3 and A.4: (A.2), then (A.4), then the completion."""

    def __init__(self, config: AsPrintedConfig, mission: FlightMission, bound: TrackingBound) -> None:
        self._config, self._mission, self._bound = config, mission, bound
        self._thrust = mission.acceleration_max - bound.feedback  # [m/s^2] what the tracker leaves to a plan
        self._box = self._thrust / math.sqrt(3.0)
        self.period = max(1, round(config.h / mission.control_period)) * mission.control_period
        self._learn(mission.knowledge)

    def plan(self, request: PlanRequest) -> Plan:
        """Plan from the plan being flown, or a failure with its reason."""
        self._listen(request)
        config, mission = self._config, self._mission
        start = self._measured(request)
        began = time.thread_time()
        nlp = EulerNlp(
            mission.terrain,
            self._cost,
            start,
            config.nodes,
            config.h,
            config.beta,
            config.epsilon * config.h * config.beta,
            mission.clearance_min,
            mission.speed_max,
            self._box,
        )
        a, status = solve(nlp, self._shifted(request))
        solve_ms = 1e3 * (time.thread_time() - began)
        plan = self._concatenated(request, nlp, a, status)
        resting = request.current is None and not start[3:].any()
        if not plan.ok and resting and nlp.depth(start[None, :3])[0] <= 0.0:
            plan = self._from_rest(request, start, plan.message)
        return replace(plan, solve_ms=solve_ms)

    def _concatenated(self, request: PlanRequest, nlp: EulerNlp, a: Array, status: Status) -> Plan:
        """Plan of the NLP's solution, the manoeuvre and the completion; a failure with its reason if not feasible."""
        if status is not Status.OK:
            return Plan.failure(status, f"the NLP (A.2): {status.value}")
        p, v = nlp.states(a)
        steps, push = self._manoeuvre(v[-1])
        if refusal := self._infeasible(nlp, p[-1] + nlp.h * v[-1], v[-1], steps, push):
            failure = Plan.failure(FlightStatus.LOW_CLEARANCE, f"the manoeuvre (A.4): {refusal}")
            return replace(failure, notes=("manoeuvre-rejected",))
        arcs = ArcList.begin(request.t_start, nlp.start)
        for a_i in (*a, np.zeros(3)):  # a_N = 0
            arcs.add(a_i, nlp.h, FlightPhase.OPTIMISED)
        arcs.add(push, steps * nlp.h, FlightPhase.MANOEUVRE)
        end = arcs.x[-1]
        arcs.x[-1] = np.array([*end[:3], 0.0, 0.0, end[5]])
        return self._completed(arcs, nlp.objective(a))

    def _from_rest(self, request: PlanRequest, start: Array, message: str) -> Plan:
        """Complete from rest above h_min, in S_s: that is the concatenated solution for k = 1 (Proposition A.2)."""
        plan = self._completed(ArcList.begin(request.t_start, start), math.nan)
        if plan.ok and not len(plan.u):
            return Plan.failure(Status.INFEASIBLE, f"the start is the target; {message}")
        return replace(plan, notes=("fallback-plan",), message=message) if plan.ok else plan

    def _completed(self, arcs: ArcList, cost: float) -> Plan:
        mission, end = self._mission, arcs.x[-1]
        if not mission.terrain.contains(end[0], end[1]):
            return Plan.failure(FlightStatus.OFF_MAP, f"the completion begins at {np.round(end[:2]).tolist()} m")
        complete(arcs, mission.terrain, self._target, mission.clearance_min, mission.speed_max, self._thrust)
        return arcs.plan(cost, math.nan)

    def _listen(self, request: PlanRequest) -> None:
        known = self._knowledge.updated_with(request.messages)
        if known is not self._knowledge:
            self._mission = replace(self._mission, terrain=known.terrain, target=known.target)
            self._learn(known)

    def _learn(self, known: Knowledge) -> None:
        self._knowledge, self._target = known, np.array(known.target)
        self._sine = steepest_sine(known.terrain)
        self._cost = _cost_to_go(known, self._config.grid_nodes, self._config.grid_layers)

    def _measured(self, request: PlanRequest) -> Array:
        """(p_c, v_c) (6,) at the hand-over.

        A deviation within its bound is left to the tracker, and the state is read from the plan; beyond the bound,
        after a jump of A.7 for instance, it is read from the measurement.
        """
        current = request.current
        if current is None:
            return request.estimate.x.copy()
        planned, error = state_at(current, request.t_start), request.estimate.x - state_at(current, request.t)
        if not self._bound.broken_by(error):
            return planned
        return planned + flow(error, np.zeros(3), request.t_start - request.t)

    def _shifted(self, request: PlanRequest) -> Array:
        """The left shift of the solution that is being flown (proof of Proposition A.2), (N - 1, 3)."""
        current, h = request.current, self._config.h
        if current is None:
            return np.zeros((self._config.nodes - 1, 3))
        middles = request.t_start + h * (np.arange(self._config.nodes - 1) + 0.5)
        return np.array([input_at(current, float(t)) for t in middles])

    def _manoeuvre(self, v: Array) -> tuple[int, Array]:
        """Steps N_bar - 1 and acceleration (3,) to vertical flight, with all the climb the box allows."""
        steps = math.ceil(self._mission.speed_max / (self._config.h * self._box) - 1e-9)
        duration = steps * self._config.h
        climb = min(self._mission.speed_max, float(v[2]) + self._box * duration)
        return steps, (np.array([0.0, 0.0, climb]) - v) / duration

    def _infeasible(self, nlp: EulerNlp, p: Array, v: Array, steps: int, push: Array) -> str:
        """Constraint of (A.4) that the manoeuvre from the node (p, v) violates at its nodes; empty if none."""
        h = nlp.h
        v_i = v + h * np.arange(steps + 1)[:, None] * push  # (N_bar, 3)
        p_i = p + h * np.vstack([np.zeros(3), np.cumsum(v_i[:-1], axis=0)])
        if not self._mission.terrain.contains(p_i[:, 0], p_i[:, 1]).all():
            return "a node is off the map"
        if (deepest := float(nlp.depth(p_i).max())) > _FEASIBLE:
            return f"a node is {deepest:.1f} m too low"
        if float(np.abs(v_i).max()) > nlp.speed + _FEASIBLE or float(np.abs(push).max()) > nlp.thrust + _FEASIBLE:
            return "it exceeds a bound"
        end = v_i[-1]
        if end[2] < float(np.linalg.norm(end)) * self._sine - _FEASIBLE:
            return "it does not end in S_s"
        return ""


@lru_cache(maxsize=4)
def steepest_sine(terrain: HeightField) -> float:
    """sin(alpha_bar), alpha_bar the largest inclination of the terrain's triangles."""
    rows, columns = terrain.z.shape
    i, j = np.meshgrid(np.arange(rows - 1.0), np.arange(columns - 1.0), indexing="ij")
    steepest = 0.0
    for east, north in ((2.0 / 3.0, 1.0 / 3.0), (1.0 / 3.0, 2.0 / 3.0)):  # the centroids of a cell's two triangles
        slope = terrain.gradient((j + east) * terrain.spacing, (i + north) * terrain.spacing)
        steepest = max(steepest, float(np.linalg.norm(slope, axis=-1).max()))
    return math.sin(math.atan(steepest))


@lru_cache(maxsize=8)
def _cost_to_go(knowledge: Knowledge, nodes: int, layers: int) -> TrilinearCost:
    return trilinear_cost(knowledge.terrain, np.array(knowledge.target), knowledge.radars, nodes, layers)
