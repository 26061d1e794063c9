"""A node at every crossing of a switching surface: the problem in parts, each smooth, of lengths that are unknowns.

A trajectory that crosses surfaces g_1 = 0, ..., g_m = 0 in this order is cut there into parts a = 1 ... m + 1. In each
part the branches are those of its middle, so that f_a, L_a and d_a are smooth, and all parts run side by side over τ:

    dx_a/dτ = T_a f_a(x_a, u_a, t_a + τ T_a; p),      J = Σ_a T_a ∫_0^1 L_a dτ + Psi(x_(m+1)(1), Σ T_a; p),
    x_(a+1)(0) = x_a(1),      g_a(x_a(1), t_a + T_a; p) = 0,

t_a the sum of the lengths before. So J chooses when the surface is crossed, and a costate may jump there along the
gradient of g_a. What is found is a solution of the problem as stated, and is replayed through that one.

A time t_k at which something is stated is a cut too, g = t - t_k. Where a free duration ends on a surface of the time,
behind which it is dearer, the last part is one of no length: it is left out, and the end may not pass the surface.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.crossings import MOST_CROSSINGS, crossings
from mathnavi.controllers.ocp.dual_solution import own_names
from mathnavi.controllers.ocp.grid import from_widths
from mathnavi.controllers.ocp.multipliers import Multipliers, NamedValues, distinct
from mathnavi.controllers.ocp.problem_functions import InstantFunctions, Interval, ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.switching_surfaces import Surfaces, branched, surfaces_of
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.controllers.ocp.transcriptions.variable_radau import VariableRadauIIA
from mathnavi.interfaces.signals import Array

_GUESSES = 41  # points of a guess
_APART = 1e-6  # of T: crossings that are nearer are one
_SHORTEST = 1e-6  # of T: least length of a part
_HAIR = 1e-9  # of the scales
_ENDING = 1e-5  # of T: nearer to the end than this, a free duration ends on a surface of the time


@dataclasses.dataclass(frozen=True, eq=False)
class Parts:
    """A problem cut where a solution crosses its surfaces."""

    problem: ProblemFunctions
    stacked: ProblemFunctions  # all parts over τ in [0, 1]
    count: int
    ending: str = ""  # in words the surface that the end may not pass

    def ends_on_surface(self, found: Solution) -> bool:
        """True if the last part has shrunk to nothing in a solution of all parts."""
        n, nx = self.count, self.problem.nx
        lengths = found.x[0, n * nx : n * nx + n]
        return bool(n > 1 and self.problem.free_duration and lengths[-1] < 0.5 * _ENDING * lengths.sum())

    def merged(self, found: Solution) -> Solution:
        """The solution of the problem, on one grid, in a solution of all parts; not replayed."""
        problem, n, nx, nu = self.problem, self.count, self.problem.nx, self.problem.nu
        lengths = found.x[0, n * nx : n * nx + n]
        T = float(lengths.sum())
        grid = from_widths((lengths[:, None] * found.grid.widths).ravel())

        def each(values: Array, size: int) -> list[Array]:
            return [values[..., a * size : (a + 1) * size] for a in range(n)]

        def per_second(values: Array, size: int) -> Array:
            return np.concatenate([own / T_a for own, T_a in zip(each(values, size), lengths, strict=True)])

        x = each(found.x, nx)
        m, nd = found.multipliers, len(problem.path_names)
        ni, ns = len(problem.initial_names), len(problem.final_names)
        at = problem.instants
        return dataclasses.replace(
            found,
            problem=problem,
            scheme=_repeated(found.scheme, n),
            grid=grid,
            duration=T,
            x=np.concatenate([*(own[:-1] for own in x), x[-1][-1:]]),
            inner=np.concatenate(each(found.inner, nx)),
            u=np.concatenate(each(found.u, nu)),
            costates=np.concatenate(each(found.costates, nx)),
            multipliers=Multipliers(
                dynamics=NamedValues(problem.states, np.concatenate(each(m.dynamics.values, nx))),
                path=NamedValues(distinct(problem.path_names), per_second(m.path.values, nd)),
                states=NamedValues(problem.states, per_second(m.states.values, nx)),
                controls=NamedValues(problem.controls, per_second(m.controls.values, nu)),
                initial=NamedValues(own_names(problem.initial_names, "start of "), m.initial.values[:ni]),
                final=NamedValues(own_names(problem.final_names, "end of "), m.final.values[:ns]),
                duration=float(m.final.values[ns]) if problem.free_duration else 0.0,
                instants=None if at is None else _instant_multipliers(at, m.final.values[ns + 1 :]),
            ),
            replay=None,
            interval_errors=None,
            surface_nodes=tuple(a * (found.nodes - 1) for a in range(1, n + bool(self.ending))),
        )


def _instant_multipliers(at: InstantFunctions, values: Array) -> NamedValues:
    return NamedValues(distinct(at.names), values[: len(at.names)])


@dataclasses.dataclass(frozen=True)
class _Cut:
    """A time [s] at which a part ends, on a surface or, where it is fixed, at that time."""

    time: float
    text: str
    surface: int | None = None


def parts_at(solution: Solution) -> Parts | str:
    """The problem of a solution, cut at all its crossings; in words why where that is not possible."""
    problem = solution.problem
    surfaces = surfaces_of(problem)
    assert surfaces is not None
    fixed = _fixed_cuts(solution)
    if isinstance(fixed, str):
        return fixed
    cuts, T, crossed = list(fixed), solution.duration, list[_Cut]()
    for crossing in crossings(solution):
        if crossing.until > crossing.time:
            return f"a node cannot be placed where {crossing}"
        if surfaces.every[crossing.surface].by_control:
            if crossing.inside:
                return f"a node cannot be placed at {crossing.text}, which depends on a control"
        else:
            crossed.append(_Cut(crossing.time, crossing.text, crossing.surface))
            if all(abs(crossing.time - other.time) > _APART * T for other in cuts):
                cuts.append(crossed[-1])
    if len(cuts) > MOST_CROSSINGS:
        return f"{len(cuts)} crossings are too many to place a node at each"
    cuts.sort(key=lambda each: each.time)
    branching = {each.surface for each in crossed if each.surface is not None}
    ending = cuts.pop() if cuts and _ends_there(solution, surfaces, cuts[-1]) else None
    return _cut(solution, surfaces, cuts, branching, ending)


def _ends_there(solution: Solution, surfaces: Surfaces, cut: _Cut) -> bool:
    """True if a free duration ends on the surface of the time at which it is cut."""
    at_end = solution.problem.free_duration and solution.duration - cut.time <= _ENDING * solution.duration
    return at_end and cut.surface is not None and not surfaces.every[cut.surface].by_state


def _fixed_cuts(solution: Solution) -> list[_Cut] | str:
    """Cuts at the times at which something is stated; in words why where it is stated at the start."""
    T, at = solution.duration, solution.problem.instants
    times = [] if at is None else (at.fractions * T).tolist()
    if any(time <= _APART * T for time in times):
        return "a node cannot be placed where something is stated at(0)"
    return [_Cut(time, f"at {time:g} s") for time in times if time < T * (1.0 - _APART)]


def _cut(
    solution: Solution, surfaces: Surfaces, cuts: Sequence[_Cut], branching: set[int], ending: _Cut | None
) -> Parts:
    """Parts between cuts, with the branches of surfaces given; at the end of the last one ``ending`` is not passed."""
    problem = solution.problem
    n, nx, nu, T = len(cuts) + 1, problem.nx, problem.nu, solution.duration
    ends = np.array([0.0, *(each.time for each in cuts), T])
    states = [f"part {a + 1}: {name}" for a in range(n) for name in problem.states]
    lengths = [f"length of part {a + 1}" for a in range(n)]
    starts = [f"start of part {a + 2}: {name}" for a in range(n - 1) for name in problem.states]
    controls = [f"part {a + 1}: {name}" for a in range(n) for name in problem.controls]
    x, u, tau = ca.SX.sym("x", len(states) + n + len(starts)), ca.SX.sym("u", len(controls)), ca.SX.sym("tau")
    p = ca.SX.sym("p", len(problem.parameters))
    own_x = [x[a * nx : (a + 1) * nx] for a in range(n)]
    T_a = [x[n * nx + a] for a in range(n)]
    begins = [sum(T_a[:a], ca.SX(0)) for a in range(n)]
    x_0 = [x[n * nx + n + a * nx :][:nx] for a in range(n - 1)]
    levels = [np.full(len(surfaces.every), np.nan) for _ in range(n)]
    for a, branches in enumerate(levels):
        for k in branching:
            branches[k] = _level_at(surfaces, solution, 0.5 * (ends[a] + ends[a + 1]))[k]
    rows = [
        branched(
            surfaces.rows,
            [own_x[a], u[a * nu : (a + 1) * nu], begins[a] + tau * T_a[a], p],
            [*surfaces.every],
            b.tolist(),
        )
        for a, b in enumerate(levels)
    ]
    rates = [T_a[a] * part[:nx] for a, part in enumerate(rows)]
    running = sum((T_a[a] * part[nx] for a, part in enumerate(rows)), ca.SX(0))
    along, whole = [x, u, tau, p], begins[-1] + T_a[-1]
    final, lower, upper = (
        [problem.final(own_x[-1], whole, p)],
        [*problem.final_bounds.lower],
        [*problem.final_bounds.upper],
    )
    names = [*problem.final_names, "duration"]
    final.append(whole)
    lower.append(problem.duration_bounds[0])
    upper.append(problem.duration_bounds[1])
    Psi = problem.terminal_cost(own_x[-1], whole, p)
    if (at := problem.instants) is not None:
        parts_of = np.abs(ends[1:, None] - at.fractions * T).argmin(axis=0)
        there = ca.vertcat(*(own_x[a] for a in parts_of))
        Psi += at.cost(there, p)
        final.append(at.rows(there, p))
        lower += [*at.bounds.lower]
        upper += [*at.bounds.upper]
        names += [*at.names]
    for a, cut in enumerate([*cuts, ending] if ending else cuts):
        now = begins[a + 1] if a < n - 1 else whole
        if cut.surface is None:
            gap, above = (now - cut.time) / T, False
        else:
            above, gap = _before(surfaces, solution, cut, levels[a], [own_x[a], ca.SX.zeros(nu), now, p])
        final.append(gap)
        names.append(f"{cut.text} at the end of part {a + 1}")
        lower.append(0.0 if a < n - 1 or above else -np.inf)
        upper.append(np.inf if a == n - 1 and above else 0.0)
        if a < n - 1:
            final.append((x_0[a] - own_x[a]) / problem.state_scale)
            names += [f"{name} on to part {a + 2}" for name in problem.states]
            lower += [0.0] * nx
            upper += [0.0] * nx
    initial = [problem.initial(own_x[0], p), *((own_x[a + 1] - x_0[a]) / problem.state_scale for a in range(n - 1))]
    joined = np.zeros((n - 1) * nx)
    of_states, of_starts = _tiled(problem.state_bounds, n), _tiled(problem.state_bounds, n - 1)
    guess = [solution.state(np.linspace(ends[a], ends[a + 1], _GUESSES)) for a in range(n)]
    constants = np.concatenate([np.diff(ends), *(solution.state(float(t)) for t in ends[1:-1])])
    # A control may jump at a crossing: it is read just inside its part.
    inside = np.linspace(1e-9, 1.0 - 1e-9, _GUESSES)
    applied = [solution.control(ends[a] + inside * (ends[a + 1] - ends[a])) for a in range(n)]
    stacked = ProblemFunctions(
        name=problem.name,
        states=(*states, *lengths, *starts),
        controls=tuple(controls),
        parameters=problem.parameters,
        dynamics=_function("f", along, [*rates, ca.SX.zeros(n + (n - 1) * nx)]),
        running_cost=_function("L", along, [running]),
        terminal_cost=_function("Psi", [x, tau, p], [Psi]),
        path=_function("d", along, [part[nx + 1 :] for part in rows]),
        initial=_function("i", [x, p], initial),
        final=_function("s", [x, tau, p], final),
        state_bounds=Interval(
            np.concatenate([of_states.lower, np.full(n, _SHORTEST * T), of_starts.lower]),
            np.concatenate([of_states.upper, np.full(n, problem.duration_bounds[1]), of_starts.upper]),
        ),
        control_bounds=_tiled(problem.control_bounds, n),
        path_bounds=_tiled(problem.path_bounds, n),
        initial_bounds=Interval(*(np.concatenate([bound, joined]) for bound in problem.initial_bounds)),
        final_bounds=Interval(np.array(lower), np.array(upper)),
        path_names=tuple(f"part {a + 1}: {name}" for a in range(n) for name in problem.path_names),
        initial_names=(
            *problem.initial_names,
            *(f"{name} of part {a + 2}" for a in range(n - 1) for name in problem.states),
        ),
        final_names=tuple(names),
        duration_bounds=(1.0, 1.0),
        state_scale=np.concatenate(
            [np.tile(problem.state_scale, n), np.diff(ends), np.tile(problem.state_scale, n - 1)]
        ),
        control_scale=np.tile(problem.control_scale, n),
        nominal=problem.nominal,
        guess_times=np.linspace(0.0, 1.0, _GUESSES),
        guess_states=np.hstack([*guess, np.tile(constants, (_GUESSES, 1))]),
        guess_controls=np.hstack(applied),
        guess_duration=1.0,
    )
    return Parts(problem, stacked, n, ending.text if ending else "")


def _before(
    surfaces: Surfaces, solution: Solution, cut: _Cut, inside: Array, arguments: list[ca.SX]
) -> tuple[bool, ca.SX]:
    """True if a part with levels ``inside`` (m,) is above the surface on which it ends, and the level over that.

    It ends a hair before the surface, so that its last point is on its own side of it.
    """
    assert cut.surface is not None
    level, size = (each.full()[:, 0] for each in surfaces.levels(*_along(solution, cut.time)))
    step = float(surfaces.every[cut.surface].nearest_step(level[[cut.surface]])[0])
    above = bool(inside[cut.surface] > step)
    hair = _HAIR * float(size[cut.surface])
    return above, surfaces.levels(*arguments)[0][cut.surface] - (step + (hair if above else -hair))


def _level_at(surfaces: Surfaces, solution: Solution, t: float) -> Array:
    """Levels (m,) at a time [s]."""
    return np.array(surfaces.levels(*_along(solution, t))[0].full())[:, 0]


def _along(solution: Solution, t: float) -> tuple[Array, Array, float, Array]:
    """Arguments x, u, t and p of what holds along a solution, at a time [s]."""
    return solution.state(t), solution.control(t), t, solution.parameters


def _tiled(bounds: Interval, times: int) -> Interval:
    return Interval(*(np.tile(each, times) for each in bounds))


def _function(name: str, arguments: list[ca.SX], results: Sequence[ca.SX]) -> ca.Function:
    return ca.Function(name, arguments, [ca.densify(ca.vertcat(ca.SX(0, 1), *results))])


def _repeated(scheme: Scheme, times: int) -> Scheme:
    """The scheme of a grid whose intervals come ``times`` one after the other."""
    return VariableRadauIIA(scheme.counts * times) if isinstance(scheme, VariableRadauIIA) else scheme
