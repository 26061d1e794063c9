"""Check of Pontryagin's conditions, one by one, along a direct solution and its multipliers.

With H = L + λ'f, minimised, path constraints d with multipliers μ and states on their bounds with multipliers μ_x,

    dynamics       x' = f(x, u): the miss of the replay, which has the tolerance of the solution
    adjoint        λ' = -(H_x + d_x'μ + μ_x): λ jumps where a limit of a state begins or ceases to hold, and falls by
                   Psi_k,x + c_k,x'ν_k at a given time
    stationarity   H_u + d_u'μ vanishes inside the bounds of u, is <= 0 at an upper and >= 0 at a lower one
    minimum        H(u) <= H(v) for every other admissible v
    convexity      H_uu >= 0 over the controls that are free (Legendre and Clebsch)
    Hamiltonian    dH/dt = H_t + μ'd_t between break times: H is constant where nothing depends on t
    start, end     λ(0) + i_x'ν_0 = 0,  λ(T) = Psi_x + s_x'ν
    duration       H(T) + Psi_T + s_T'ν + κ = 0 for a free T, κ the multiplier of its bounds
    signs          a multiplier is 0 where its limit does not hold, >= 0 at an upper and <= 0 at a lower limit

At a node on a switching surface g(x, t) = 0 (see ``crossing_phases``) λ may fall by ν g_x, where H rises by ν g_t.

A control in which H is linear has a switching function H_u. Where that vanishes over an arc, the minimum does not
determine the control; checked there is d(H_u)/dt = 0 and, for a single such control, -∂/∂u d²(H_u)/dt² >= 0 (Kelley). A
condition that cannot be judged is listed by name with its reason. A residual is relative to the size of the terms in
its sum; that of a differential equation is the mean over time of the difference between its integrated right side and
its left.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from functools import cached_property

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.clocks import clocks_of
from mathnavi.controllers.ocp.crossings import crossings
from mathnavi.controllers.ocp.multipliers import NamedValues
from mathnavi.controllers.ocp.optimality_conditions import ConditionVerdict, OptimalityCondition, PontryaginCheck
from mathnavi.controllers.ocp.pontryagin_terms import (
    controls_linear_in_hamiltonian,
    end_gradients,
    hamiltonian_terms,
    instant_gradients,
    is_quadratic,
    start_gradient,
    switching_terms,
)
from mathnavi.controllers.ocp.problem_functions import Interval
from mathnavi.controllers.ocp.reached_limits import TOUCHING, Flags, constraint_sizes, path_values, touched, wrong_signs
from mathnavi.controllers.ocp.solution_view import SolutionView
from mathnavi.controllers.ocp.switching_surfaces import surfaces_of
from mathnavi.controllers.ocp.transcriptions.variable_radau import (
    interval_integral_weights,
    interval_points,
    interval_weights,
)
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.stretches import stretches

TOLERANCE = 1e-2
"""allowed residual of a condition by default"""

_SINGULAR = 3e-2  # of the largest switching function: how small it is on a singular arc
_LEAST_ARC = 3  # intervals of a singular arc
_SAMPLES = 21  # of a control, for the minimum
_SMALL = 1e-9


def check_pontryagin(solution: SolutionView, *, tolerance: float = TOLERANCE) -> PontryaginCheck:
    """Judge Pontryagin's conditions along a direct solution.

    Args:
        solution: by a collocation scheme.
        tolerance: largest residual with which a condition holds.

    Returns:
        Every condition with its verdict; those that cannot be judged with their reason.

    Raises:
        ProblemError: for a solve that failed and a scheme of one point, whose control is held: the conditions then hold
            in the mean of an interval only.
    """
    if not solution.solved:
        raise ProblemError(f"the solution of {solution.problem.name} failed: {solution.status.value}")
    if len(solution.scheme.points) < 2:
        raise ProblemError(f"scheme = {solution.scheme.name} holds its control; allowed: a collocation scheme")
    return PontryaginCheck(solution.problem.name, tolerance, tuple(_Judge(solution, tolerance).conditions()))


def _not_judged(name: str, reason: str) -> OptimalityCondition:
    return OptimalityCondition(name, ConditionVerdict.NOT_JUDGED, reason=reason)


class _Judge:
    """The terms of the conditions at the scheme's points (N - 1, k, ...), and the verdicts from them."""

    def __init__(self, solution: SolutionView, tolerance: float) -> None:
        self.solution, self.problem, self.tolerance = solution, solution.problem, tolerance
        problem, m = self.problem, solution.multipliers
        self.count, self.k = solution.u.shape[:2]
        self.shares, self.times = solution.point_shares, solution.point_times
        self.costates = m.dynamics.values
        names = ("H", "H_size", "H_x", "H_t", "H_u", "u_size", "H_uu", "switching")
        found = hamiltonian_terms(problem).map(self.times.size)(*self._arguments(solution.u))
        nx, nu = problem.nx, problem.nu
        shapes = ((), (), (nx,), (), (nu,), (nu,), (nu, nu), (nu,))
        terms = {
            name: np.array(value.full()).T.reshape(self.count, self.k, *shape)
            for name, value, shape in zip(names, found, shapes, strict=True)
        }
        self.H, self.H_x, self.H_t, self.H_uu = terms["H"], terms["H_x"], terms["H_t"], terms["H_uu"]
        self.H_u, self.switching = self._joined(terms["H_u"]), self._joined(terms["switching"])
        self.H_size = max(float(terms["H_size"].max()), _SMALL)
        self.u_size = np.maximum(terms["u_size"].max(axis=(0, 1)), _SMALL)
        extent = problem.control_bounds.upper - problem.control_bounds.lower
        self.u_scale = np.where(np.isfinite(extent), np.maximum(extent, _SMALL), problem.control_scale)
        near = TOUCHING * self.u_scale
        self.at_lower = solution.u - problem.control_bounds.lower <= near
        self.at_upper = problem.control_bounds.upper - solution.u <= near
        rates = [clock.rate for clock in clocks_of(problem)]  # what they are is no matter of the problem
        self.at_lower[:, :, rates], self.at_upper[:, :, rates] = True, True
        self.linear = controls_linear_in_hamiltonian(problem)

    def _arguments(self, u: Array) -> tuple[Array, ...]:
        """Arguments of the functions of this module at all points, with controls u (N - 1, k, nu)."""
        s, n = self.solution, self.times.size
        mu = s.multipliers.path.values
        return (
            s.inner.reshape(n, -1).T,
            u.reshape(n, -1).T,
            self.times.reshape(1, n),
            np.tile(s.parameters[:, None], (1, n)),
            self.costates.reshape(n, -1).T,
            mu.reshape(n, -1).T,
        )

    def _joined(self, values: Array) -> Array:
        """Values with the mean, by shares, of both sides of a node whose control two intervals have in common."""
        if not self.solution.scheme.shared:
            return values
        joined, first, last = values.copy(), self.shares[1:, 0, None], self.shares[:-1, -1, None]
        mean = (first * values[1:, 0] + last * values[:-1, -1]) / (first + last)
        joined[1:, 0], joined[:-1, -1] = mean, mean
        return joined

    def conditions(self) -> Iterator[OptimalityCondition]:
        yield self._dynamics()
        yield self._adjoint()
        if self.problem.nu:
            yield self._judged("stationarity", self._stationarity())
            yield from self._minimum()
            yield from self._convexity()
        yield self._judged("Hamiltonian", self._rate_of_hamiltonian())
        yield from self._ends()
        yield self._judged("signs", self._signs())
        yield from self._not_unique()

    def _judged(self, name: str, residual: float) -> OptimalityCondition:
        verdict = (
            ConditionVerdict.HOLDS if residual <= self.tolerance else ConditionVerdict.VIOLATED
        )  # NaN is none of them
        return OptimalityCondition(name, verdict, residual)

    def _dynamics(self) -> OptimalityCondition:
        s = self.solution
        if s.replay is None:
            return _not_judged("dynamics", "the solution is not replayed")
        holds = s.replay.miss <= (s.tolerance if math.isfinite(s.tolerance) else self.tolerance)
        verdict = ConditionVerdict.HOLDS if holds else ConditionVerdict.VIOLATED
        return OptimalityCondition("dynamics", verdict, s.replay.miss)

    # the adjoint equation

    def _halves(self, smooth: Array, atoms: Array) -> tuple[Array, Array]:
        """Integrals (N - 1, ...) over the first and the second half of every interval.

        ``smooth`` is a function of time at the points, ``atoms`` are integrals that each point stands for.
        """
        points = interval_points(self.solution.scheme)
        ends = np.diff(self.solution.t)[:, None, None] * interval_integral_weights(
            self.solution.scheme, np.array([0.5, 1.0])
        )
        early = np.broadcast_to(np.where(np.abs(points - 0.5) < 1e-12, 0.5, points < 0.5), self.times.shape)
        first: Array = np.einsum("nk,nk...->n...", ends[:, 0], smooth) + np.einsum("nk,nk...->n...", early, atoms)
        whole = np.einsum("nk,nk...->n...", ends[:, 1], smooth) + atoms.sum(axis=1)
        return first, whole - first

    def _forces(self) -> tuple[Array, Array]:
        """Integrals of H_x + d_x'μ + μ_x over both halves of every interval."""
        return self._halves(self.H_x, self.solution.multipliers.states.values * self.shares[:, :, None])

    @property
    def _middle(self) -> Array:
        """Costates (N - 1, nx) in the middle of every interval."""
        middle: Array = (interval_weights(self.solution.scheme, np.array([0.5])) @ self.costates)[:, 0]
        return middle

    @property
    def _costate_size(self) -> Array:
        """Magnitude (nx,) of each costate; one that vanishes gets that of the others."""
        scaled = np.abs(self.costates).max(axis=(0, 1)) * self.problem.state_scale
        least = max(1e-3 * float(scaled.max(initial=0.0)), _SMALL)
        size: Array = np.maximum(scaled, least) / self.problem.state_scale
        return size

    @cached_property
    def _falls(self) -> Array:
        """(N, nx) what λ falls by at each node, where something is stated at its time."""
        s, found = self.solution, np.zeros((self.solution.nodes, self.problem.nx))
        if self.problem.instants is not None and s.multipliers.instants is not None:
            known = s.at_instants.ravel(), s.parameters, s.multipliers.instants.values
            gradients = np.array(instant_gradients(self.problem)(*known).full())
            found[s.instant_nodes] = gradients.reshape(-1, self.problem.nx)
        return found

    def _adjoint(self) -> OptimalityCondition:
        first, second = self._forces()
        defect = np.diff(self._middle, axis=0) + second[:-1] + first[1:] + self._falls[1:-1]
        for node, normal in self._normals.items():
            defect[node - 1] += self._surface_multiplier(node) * normal[:-1]
        drift = np.vstack([np.zeros(self.problem.nx), np.cumsum(defect, axis=0)])
        apart = self.solution.grid.widths @ np.abs(drift - np.median(drift, axis=0))
        return self._judged("adjoint", float((apart / self._costate_size).max(initial=0.0)))

    @cached_property
    def _normals(self) -> dict[int, Array]:
        """∂g/∂(x, t) (nx + 1,) of the switching surface on which each of the ``surface_nodes`` is."""
        s, nx, surfaces = self.solution, self.problem.nx, surfaces_of(self.problem)
        found = {}
        for crossing in crossings(s) if s.surface_nodes else ():
            node = int(np.abs(s.t - crossing.time).argmin())
            if surfaces is not None and node in s.surface_nodes and not crossing.inside:
                rows = np.array(surfaces.normals(s.x[node], s.u[node, 0], s.t[node], s.parameters).full())
                found[node] = np.append(rows[crossing.surface, :nx], rows[crossing.surface, -1])
        return found

    def _surface_multiplier(self, node: int) -> float:
        """ν of a surface: λ falls there by ν g_x, and H rises by ν g_t."""
        first, second = self._forces()
        jump = self._middle[node] - self._middle[node - 1] + second[node - 1] + first[node]
        scale = self.problem.state_scale
        normal = self._normals[node][:-1] * scale
        length = float(normal @ normal)
        return -float(normal @ (jump * scale)) / length if length > 0.0 else 0.0

    # the control

    def _stationarity(self) -> float:
        inward = np.where(
            self.at_upper, np.maximum(self.H_u, 0.0), np.where(self.at_lower, np.minimum(self.H_u, 0.0), self.H_u)
        )
        fixed = self.at_lower & self.at_upper
        return float((np.abs(np.where(fixed, 0.0, inward)) / self.u_size).max(initial=0.0))

    def _minimum(self) -> Iterator[OptimalityCondition]:
        problem, (lower, upper) = self.problem, self.problem.control_bounds
        coupled = problem.path.jac_sparsity(0, 1).nnz() > 0
        gains = [0.0]
        rates = [clock.rate for clock in clocks_of(problem)]
        for j, name in enumerate(problem.controls):
            if j in rates:
                continue
            if coupled:
                yield OptimalityCondition(
                    f"minimum over {name}", ConditionVerdict.NOT_JUDGED, reason="a path constraint limits the controls"
                )
            elif np.isfinite(lower[j]) and np.isfinite(upper[j]):
                gains.append(max(self._gain(j, value) for value in np.linspace(lower[j], upper[j], _SAMPLES)))
            elif not is_quadratic(problem, j):
                yield OptimalityCondition(
                    f"minimum over {name}",
                    ConditionVerdict.NOT_JUDGED,
                    reason="it has no bounds, and H is not quadratic in it",
                )
        yield self._judged("minimum", max(gains) / self.H_size)

    def _gain(self, j: int, value: float) -> float:
        """Largest decrease of H by another value of control j."""
        other = self.solution.u.copy()
        other[:, :, j] = value
        found = hamiltonian_terms(self.problem).map(self.times.size)(*self._arguments(other))[0]
        change = self._joined((self.H - np.array(found.full()).reshape(self.H.shape))[:, :, None])
        return float(change.max())

    def _convexity(self) -> Iterator[OptimalityCondition]:
        free = ~(self.at_lower | self.at_upper)
        regular = free & ~np.array(self.linear)
        masked = self.H_uu * regular[..., :, None] * regular[..., None, :]
        size = max(float(np.abs(masked).max(initial=0.0)), _SMALL)
        finite = bool(np.isfinite(masked).all())
        least = float(np.linalg.eigvalsh(masked).min(initial=0.0)) if finite else math.nan
        if not all(self.linear):
            yield self._judged("convexity", abs(min(least, 0.0)) / size)
        arcs = [(j, *arc) for j in range(self.problem.nu) if self.linear[j] for arc in self._singular_arcs(j)]
        several = len({j for j, _, _ in arcs}) > 1 or sum(self.linear) > 1
        for j, first, last in arcs:
            yield from self._singular(j, first, last, several)

    def _singular_arcs(self, j: int) -> Iterator[tuple[int, int]]:
        """First interval, and the one after the last, of every arc on which a switching function vanishes."""
        switching = np.abs(self.switching[:, :, j])
        small = (switching <= _SINGULAR * max(float(switching.max()), _SMALL)).all(axis=1)
        inside = ~(self.at_lower[:, :, j] | self.at_upper[:, :, j]).all(axis=1)
        for first, last in stretches(np.asarray(small & inside)).tolist():
            if last - first >= _LEAST_ARC:
                yield first, last

    def _singular(self, j: int, first: int, last: int, several: bool) -> Iterator[OptimalityCondition]:
        # The switching function is judged inside the arc: its ends lie in the first and the last interval.
        inside = slice(first + 1, last - 1)
        on_limit = np.concatenate([self._on_bound[inside], self._on_path[inside]], axis=2)
        if (on_limit.mean(axis=(0, 1)) >= 0.5).any():  # a limit of a state holds, and determines the control
            return
        name, t = self.problem.controls[j], self.solution.t
        arc = f"on the singular arc of {name} from {t[first]:.4g} to {t[last]:.4g} s"
        yield _not_judged(f"minimum {arc}", f"H does not depend on {name} there")
        if several or on_limit.any():
            why = "several controls are linear in H" if several else "a limit holds on a part of it"
            yield _not_judged(f"derivatives of H_u {arc}", why)
            return
        rate, size, kelley = (
            np.array(value.full()).reshape(self.count, self.k)[inside]
            for value in switching_terms(self.problem, j).map(self.times.size)(*self._arguments(self.solution.u)[:5])
        )
        yield self._judged(f"d(H_u)/dt = 0 {arc}", float(np.abs(rate).max() / max(float(size.max()), _SMALL)))
        if not np.abs(kelley).max() > _SMALL * float(size.max()):
            yield _not_judged(f"Kelley's condition {arc}", "the arc is of a higher order")
        else:
            yield self._judged(
                f"Kelley's condition {arc}", max(0.0, -float(kelley.min())) / float(np.abs(kelley).max())
            )

    @cached_property
    def _on_bound(self) -> Flags:
        """(N - 1, k, nx) where a state is on a bound."""
        return touched(self.solution.inner, self.problem.state_bounds, self.problem.state_scale)

    @cached_property
    def _path(self) -> Array:
        """Values (N - 1, k, nd) of the path constraints."""
        return path_values(self.solution)

    @cached_property
    def _on_path(self) -> Flags:
        """(N - 1, k, nd) where a path constraint is on a limit."""
        limits = self.problem.path_bounds
        return touched(self._path, limits, constraint_sizes(self._path, limits))

    # the Hamiltonian and the ends

    def _rate_of_hamiltonian(self) -> float:
        """dH/dt = H_t between the middles of the intervals; H there is its mean, in which ringing cancels.

        Each part between break times by itself, for H may jump at one.
        """
        mean = (self.H * self.shares).sum(axis=1) / self.shares.sum(axis=1)
        first, second = self._halves(self.H_t, np.zeros_like(self.H_t))
        gained = np.concatenate([[0.0], np.cumsum(second[:-1] + first[1:])])
        drift, widths = mean - gained, self.solution.grid.widths
        for node, normal in self._normals.items():
            drift[node:] -= (
                self._surface_multiplier(node) * normal[-1] if normal[:-1].any() else np.diff(drift)[node - 1]
            )
        middles = self.solution.grid.nodes[:-1] + 0.5 * widths
        part = np.searchsorted(self.problem.breaks, middles)
        for k in np.unique(part):
            drift[part == k] -= np.median(drift[part == k])
        return float(widths @ np.abs(drift)) / self.H_size

    def _ends(self) -> Iterator[OptimalityCondition]:
        if self.solution.linked:
            why = "they are linked with those of other phases: judge the solution of all phases, stacked"
            yield from (_not_judged(name, why) for name in ("start", "end"))
            return
        s, problem, p, m = self.solution, self.problem, self.solution.parameters, self.solution.multipliers
        first, second = self._forces()
        size = self._costate_size
        at_start, at_end = self._middle[0] + first[0] + self._falls[0], self._middle[-1] - second[-1] - self._falls[-1]
        nu_0, nu = m.initial.values, m.final.values
        by_x, by_T = end_gradients(problem)(s.x[-1], s.duration, p, nu)
        start = np.abs(at_start + np.array(start_gradient(problem)(s.x[0], p, nu_0).full())[:, 0]) / size
        end = np.abs(at_end - np.array(by_x.full())[:, 0]) / size
        points = s.scheme.points
        for name, row, known, residual in (("start", 0, points[0] == 0.0, start), ("end", -1, points[-1] == 1.0, end)):
            lost = touched(s.x[row], problem.state_bounds, problem.state_scale) & (residual > self.tolerance)
            if not known and lost.any():
                states = ", ".join(state for state, on in zip(problem.states, lost, strict=True) if on)
                why = f"{s.scheme.name} has no point there, and {states} is on its bound"
                yield _not_judged(f"{name} of {states}", why)
                residual = np.where(lost, 0.0, residual)
            yield self._judged(name, float(residual.max(initial=0.0)))
        if problem.free_duration:
            at_T = float((interval_weights(s.scheme, np.ones(1))[-1, 0] * self.H[-1]).sum())
            size_T = max(self.H_size, abs(float(by_T)))
            yield self._judged("duration", abs(at_T + float(by_T) + m.duration) / size_T)

    # multipliers

    def _signs(self) -> float:
        s, problem, m = self.solution, self.problem, self.solution.multipliers
        initial = np.array(problem.initial(s.x[0], s.parameters).full())[:, 0]
        final = np.array(problem.final(s.x[-1], s.duration, s.parameters).full())[:, 0]
        of_ends = max(float((self._costate_size * problem.state_scale).max(initial=0.0)), _SMALL)
        of_states = m.states.values.copy()
        of_states[:, :, [clock.state for clock in clocks_of(problem)]] = 0.0  # its end is one of the programme's bounds
        states = dataclasses.replace(m.states, values=of_states)
        worst = [
            wrong_signs(states, s.inner, problem.state_bounds, problem.state_scale, self.H_size),
            wrong_signs(
                m.path, self._path, problem.path_bounds, constraint_sizes(self._path, problem.path_bounds), self.H_size
            ),
            wrong_signs(
                m.initial, initial, problem.initial_bounds, constraint_sizes(initial, problem.initial_bounds), of_ends
            ),
            wrong_signs(m.final, final, problem.final_bounds, constraint_sizes(final, problem.final_bounds), of_ends),
        ]
        if problem.free_duration:
            T, own = np.array([s.duration]), NamedValues(("T",), np.array([m.duration]))
            bounds = Interval(*(np.array([bound]) for bound in problem.duration_bounds))
            worst.append(wrong_signs(own, T, bounds, T, s.duration * self.H_size))
        return max(worst)

    def _not_unique(self) -> Iterator[OptimalityCondition]:
        """States that stay on a bound because every control that moves them is on a bound, too."""
        problem = self.problem
        depends = np.array(ca.DM(problem.dynamics.jac_sparsity(0, 1), 1.0).full(), bool).reshape(problem.nx, problem.nu)
        on_bound: Flags = np.asarray(self._on_bound.all(axis=1))
        pressed: Flags = np.asarray((self.at_lower | self.at_upper).all(axis=1))
        for i, name in enumerate(problem.states):
            moving = depends[i]
            if moving.any():
                there = on_bound[:, i] & pressed[:, moving].all(axis=1)
                if there.any():
                    held = ", ".join(u for u, on in zip(problem.controls, moving, strict=True) if on)
                    why = f"{name} and {held} are on their bounds at once: only the sum of what holds them is known"
                    yield _not_judged(f"multipliers of {name} and {held} apart", why)
