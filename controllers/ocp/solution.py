"""Solutions: states and controls as functions of time, costates, status, and the replay."""

from __future__ import annotations

import dataclasses
import io
import math
from collections.abc import Callable
from dataclasses import astuple, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from mathnavi.controllers.ocp.grid import Grid
from mathnavi.controllers.ocp.multipliers import Multipliers, NamedValues, column_of
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.records import encoded
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.controllers.ocp.transcriptions.variable_radau import (
    interval_integral_weights,
    interval_points,
    located_weights,
    point_counts,
)
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.short_tables import Row, html_table, short_table, vector_text
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.interfaces.writing import write_bytes
from mathnavi.models.nlp_solver import SolverOutcome as SolverOutcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mathnavi.controllers.ocp.optimality_conditions import PontryaginCheck

FORMAT = "mathnavi solution 1"
"""format that the file of a solution names"""
RECORD = "solution"


@dataclass(frozen=True, repr=False)
class Timing:
    """Wall-clock times [ms] of one solution.

    ``gate_ms`` is the time of the uniform solution that an adaptive one was only compared with, ``verify_ms`` that of
    finding out what the solution may be called.
    """

    build_ms: float = 0.0  # of programmes, zero where one was built before
    solve_ms: float = 0.0
    replay_ms: float = 0.0
    gate_ms: float = 0.0
    verify_ms: float = 0.0

    @property
    def total_ms(self) -> float:
        """The whole time [ms]."""
        return float(sum(astuple(self)))

    def __repr__(self) -> str:
        """One line."""
        parts = [
            f"{field.name.removesuffix('_ms')} {ms:.1f}" for field, ms in zip(fields(self), astuple(self), strict=True)
        ]
        return f"{self.total_ms:.1f} ms ({', '.join(parts)})"

    def __add__(self, other: Timing) -> Timing:
        return Timing(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


@dataclass(frozen=True, repr=False)
class ReplayResult:
    """The control, saturated to its bounds, flown through the true dynamics from the solution's own start.

    The figures are judged one by one; all are infinite where the integration diverges (see ``replay``). The control
    violation concerns neither the replayed control nor that of ``Solution.control``, which keep the bounds; the effect
    of saturation is in the other figures.
    """

    miss: float  # scaled: largest |x_replayed(T) - x(T)| / x_scale, or the sum of the intervals' defects
    path_violation: float  # largest violation of state bounds and path constraints on a dense grid, scaled
    control_violation: float  # largest excess of the scheme's control over its bounds, as a share of their range
    cost_error: float  # |J_replayed - J| / max(1, |J|); of a small J by its units, over its scale
    cost: float  # J along the replay
    end: Array  # (nx,) x_replayed(T); where the replay is by intervals, x(T) + the last interval's defect
    by_intervals: bool  # open loop is ill-posed, so each interval was re-integrated from its own node
    one_piece: float = math.nan  # scaled: the miss of a flight from start to end all the same, where it is by intervals

    @property
    def figures(self) -> dict[str, float]:
        """The figures that a solution is judged by: miss, path violation and cost error."""
        return {"miss": self.miss, "path violation": self.path_violation, "cost error": self.cost_error}

    @property
    def error(self) -> float:
        """The largest of the figures: at most a tolerance where the solution is accurate."""
        return max(self.figures.values())

    @property
    def rows(self) -> list[Row]:
        """Rows of a table: each figure by its name."""
        return [
            ("replayed J", f"{self.cost:.7g}", ""),
            ("replay miss", f"{self.miss:.2g}", "by intervals" if self.by_intervals else ""),
            *([("replay miss", f"{self.one_piece:.2g}", "in one piece")] if self.by_intervals else []),
            ("path violation", f"{self.path_violation:.2g}", ""),
            ("control violation", f"{self.control_violation:.2g}", ""),
            ("cost error", f"{self.cost_error:.2g}", ""),
        ]

    def __repr__(self) -> str:
        """A short table: each figure by its name, and where the replay ends."""
        return short_table("replay", [*self.rows, ("end", vector_text(self.end), "")])


@dataclass(frozen=True, eq=False)
class SolvedProgramme:
    """Programme that a solution was read from, and the solver's answer, in the programme's own scaled unknowns."""

    programme: Any  # nlp.Programme, whose module imports this one
    x: Array  # (n,)
    known: Array  # the programme's parameters p
    bounds: tuple[Array, Array, Array, Array]  # lower and upper (n,) of the unknowns, then (m,) of the rows
    multipliers: tuple[Array, Array]  # of the bounds (n,) and of the rows (m,)
    grid: Grid  # of the answer
    read: Callable[[Array], Solution]  # the solution at other unknowns (n,), with the rest of the answer

    @property
    def without_smoothing(self) -> Array:
        """The known values with weights ρ = 0 of the controls' variations, which are no part of J."""
        layout, values = self.programme.layout, self.known.copy()
        values[len(values) - layout.smoothed * (layout.nodes - 1) :] = 0.0
        return values


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """Solution of a transcribed problem: states x_i at N nodes, controls at the scheme's points, the final time T.

    ``status`` says how the solve ended and ``ok`` whether this solves the problem to the requested tolerance;
    after a failed solve the arrays hold the solver's last iterate. Values are in the problem's units, times in s since
    the start. Where intervals have different numbers of points, k is the largest, and an interval of fewer repeats its
    last one, with no share in integrals.
    """

    problem: ProblemFunctions
    scheme: Scheme
    status: SolverOutcome
    message: str
    grid: Grid
    duration: float  # [s] T
    parameters: Array  # (np,)
    x: Array  # (N, nx)
    inner: Array  # (N - 1, k, nx) states at the scheme's k points
    u: Array  # (N - 1, k, nu) controls there
    costates: Array  # (N - 1, nx) λ at ``costate_times``, H = L + λ'f
    cost: float  # J as the transcription sees it
    iterations: int
    timing: Timing
    multipliers: Multipliers
    sensitivities: NamedValues  # (np,) dJ/dp of the least J, by the names of the parameters
    method: str = "direct"
    replay: ReplayResult | None = None
    interval_errors: Array | None = None  # (N - 1,) largest defect of each interval, over the states' scales
    tolerance: float = math.nan  # of miss, path violation and cost error of the replay, that the status was judged by
    surface_nodes: tuple[int, ...] = ()  # nodes that the programme holds on a surface where the problem is not smooth
    linked: bool = False  # a phase of several, whose ends are conditions of them all
    not_smooth: tuple[str, ...] = ()  # jumps and kinks that the trajectory crosses inside an interval, in words
    cost_bound: float = math.nan  # E: J is at most this far from the least value nearby; NaN where it is not estimated
    solved_programme: SolvedProgramme | None = field(
        default=None, metadata={"saved": False}
    )  # None once it is verified

    @property
    def ok(self) -> bool:
        """True if this is a solution of the problem: optimal, smooth, and within the tolerance when it is replayed."""
        accurate = self.replay is not None and self.replay.error <= self.tolerance
        named = self.status in (SolverOutcome.OPTIMAL, SolverOutcome.REFUSED)
        return accurate and named and not self.not_smooth

    @property
    def solved(self) -> bool:
        """True if this is a solution of the transcribed programme, regardless of its accuracy."""
        interrupted = self.status is SolverOutcome.INTERRUPTED and self.replay is not None  # only what is solved flies
        return interrupted or self.status in (
            SolverOutcome.OPTIMAL, SolverOutcome.CONVERGED, SolverOutcome.STATIONARY, SolverOutcome.REFUSED,
        )  # fmt: skip

    @cached_property
    def conditions(self) -> PontryaginCheck | None:
        """Pontryagin's conditions; None for a failed solve and a scheme that holds its control."""
        from mathnavi.controllers.ocp.pontryagin import check_pontryagin  # it judges solutions, so it imports this

        return check_pontryagin(self) if self.solved and len(self.scheme.points) > 1 else None

    def solves(self, problem: ProblemFunctions, parameters: Array) -> bool:
        """True if this is a solution of a programme of this problem for these parameters (np,)."""
        return self.solved and self.problem is problem and bool(np.array_equal(self.parameters, parameters))

    @property
    def headline(self) -> str:
        """One line: the problem, J and T and, if it is not a solution, the reason."""
        method = "" if self.method == "direct" else f", {self.method}"
        failure = "" if self.status is SolverOutcome.OPTIMAL else f"; {self.status.value}"
        return f"{self.problem.name}{method}: J = {self.cost:.7g}, T = {self.duration:.6g} s{failure}"

    def __repr__(self) -> str:
        """A short table: how it ended, what it costs, and what its replay says."""
        return f"{short_table(*self._table())}\n  {self.message}"

    def _repr_html_(self) -> str:
        """The same table, for a notebook."""
        return html_table(*self._table())

    def _table(self) -> tuple[str, list[Row]]:
        rows = [
            ("J", f"{self.cost:.7g}", ""),
            ("error of J", f"{self.cost_bound:.2g}" if math.isfinite(self.cost_bound) else "not estimated", ""),
            ("T", f"{self.duration:.7g}", "s"),
            ("scheme", self.scheme.name, ""),
            ("nodes", str(self.nodes), ""),
            ("iterations", str(self.iterations), ""),
            ("time", f"{self.timing.total_ms:.0f}", "ms"),
        ]
        rows += [(f"dJ/d{name}", f"{float(self.sensitivities[name]):.6g}", "") for name in self.sensitivities]
        if self.replay is not None:
            rows += self.replay.rows
        if self.conditions is not None:
            rows.append(("Pontryagin", self.conditions.summary, ""))
        return f"{self.problem.name}, {self.method}: {self.status.value}", rows

    def __getitem__(self, name: str) -> Array:
        """(N,) a state or a control by its name, at the nodes ``t``; (N, k) a vector of k components.

        KeyError names those that exist.
        """
        return self._named(name, lambda: self.x, lambda: self.control(self.t))

    def __call__(self, name: str, t: Array | float) -> Array:
        """() a state or a control by its name at a time t [s], or (n,) at times (n,), held to [0, T].

        A vector of k components has a last axis more. KeyError names the states and controls that exist.
        """
        return self._named(name, lambda: self.state(t), lambda: self.control(t))

    def _named(self, name: str, states: Callable[[], Array], controls: Callable[[], Array]) -> Array:
        problem = self.problem
        for names, values in ((problem.states, states), (problem.controls, controls)):
            if (column := column_of(name, names)) is not None:
                own: Array = values()[..., column]
                return own
        known = allowed_for(name, problem.states + problem.controls)
        raise KeyError(f"{name!r} is no state or control; {known}")

    @property
    def nodes(self) -> int:
        """Number of nodes N."""
        return len(self.grid)

    @property
    def t(self) -> Array:
        """Times (N,) [s] of the nodes."""
        return self.grid.nodes * self.duration

    @property
    def at_instants(self) -> Array:
        """States (m, nx) at the times at which the problem states a cost or constraints; those nodes are there."""
        found = self.problem.instants
        return self.x[self.instant_nodes] if found is not None else np.empty((0, self.problem.nx))

    @property
    def instant_nodes(self) -> Integers:
        """Indices (m,) of the nodes at these times."""
        found = self.problem.instants
        fractions = np.empty(0) if found is None else found.fractions
        nearest: Integers = np.abs(self.grid.nodes[:, None] - fractions).argmin(axis=0).astype(np.int64)
        return nearest

    @property
    def costate_times(self) -> Array:
        """Times (N - 1,) [s] of the costates."""
        times: Array = self.t[:-1] + self.scheme.costate_at * np.diff(self.t)
        return times

    @property
    def point_times(self) -> Array:
        """Times (N - 1, k) [s] of the scheme's k points in each interval: of ``inner``, ``u`` and the multipliers."""
        times: Array = self.t[:-1, None] + interval_points(self.scheme) * np.diff(self.t)[:, None]
        return times

    @property
    def point_shares(self) -> Array:
        """Time (N - 1, k) [s] that each of these points stands for in the scheme's quadrature."""
        shares: Array = np.diff(self.t)[:, None] * interval_integral_weights(self.scheme, np.ones(1))[:, 0]
        return shares

    @cached_property
    def hamiltonian(self) -> Array:
        """Hamiltonian H = L + λ'f (N - 1, k) at ``point_times``; constant in time where nothing depends on t."""
        problem, times = self.problem, self.point_times
        x, u, t = self.inner.reshape(-1, problem.nx), self.u.reshape(times.size, problem.nu), times.ravel()
        cost = problem.running_cost.map(len(t))(x.T, u.T, t[None, :], np.tile(self.parameters[:, None], (1, len(t))))
        running = np.array(cost.full())[0].reshape(times.shape)
        values: Array = running + (self.multipliers.dynamics.values * self.rates).sum(axis=2)
        return values

    def costate(self, t: Array | float) -> Array:
        """Costate λ (nx,) at a time t [s], or (n, nx) at times (n,), held to [0, T].

        The polynomial through an interval's points, straight from node to node for a scheme of one point.
        """
        times = np.clip(np.atleast_1d(np.asarray(t, float)), 0.0, self.duration)
        values = self.multipliers.dynamics.values
        if len(self.scheme.points) > 1:
            interval, fraction = self._locate(times)
            basis = located_weights(self.scheme, interval, fraction)
            found: Array = np.einsum("nk,nkm->nm", basis, values[interval])
        else:
            known = self.point_times[:, 0]
            found = np.array([np.interp(times, known, column) for column in values[:, 0].T]).T
        return found[0] if np.ndim(t) == 0 else found

    @cached_property
    def rates(self) -> Array:
        """Rates f(x, u, t; p) (N - 1, k, nx), in units per second, at the scheme's k points of each interval."""
        count, k, nx = self.inner.shape
        times = self.point_times.ravel()
        rates = along(self.problem, self.inner.reshape(-1, nx), self.u.reshape(count * k, -1), times, self.parameters)
        return rates.reshape(count, k, nx)

    def control(self, t: Array | float) -> Array:
        """Control u (nu,) at a time t [s], or (n, nu) at times (n,), held to [0, T].

        The scheme's polynomial, saturated to the control's bounds as an actuator would be; at a node that of the
        interval which begins there.
        """
        times = np.atleast_1d(np.asarray(t, float))
        interval, fraction = self._locate(times)
        basis = located_weights(self.scheme, interval, fraction)
        values: Array = np.clip(np.einsum("nk,nkm->nm", basis, self.u[interval]), *self.problem.control_bounds)
        return values[0] if np.ndim(t) == 0 else values

    def state(self, t: Array | float) -> Array:
        """State x (nx,) at a time t [s], or (n, nx) at times (n,), held to [0, T].

        The collocation polynomial x_i + d Σ_j f_j ∫_0^c l_j or, of a scheme of one point, a monotone cubic through the
        nodes.
        """
        times = np.atleast_1d(np.asarray(t, float))
        interval, fraction = self._locate(times)
        d = np.diff(self.t)[interval]
        if len(self.scheme.points) > 1:
            basis = located_weights(self.scheme, interval, fraction, integral=True)
            values: Array = self.x[interval] + d[:, None] * np.einsum("nk,nkm->nm", basis, self.rates[interval])
        else:
            values = np.array(PchipInterpolator(self.t, self.x, axis=0)(np.clip(times, 0.0, self.duration)))
        return values[0] if np.ndim(t) == 0 else values

    def scaled_derivative(self, tau: Array, order: int) -> Array:
        """Derivative (k, nx) of x~ = S^-1 x with respect to τ = t / T, of order 1, 2 or 3, at fractions τ (k,).

        From a spline through the rates at all of the scheme's points, so that the third derivative exists for every
        scheme.
        """
        values: Array = self._rate_spline(tau, order - 1)
        return values

    @cached_property
    def _rate_spline(self) -> CubicSpline:
        points, widths = interval_points(self.scheme), self.grid.widths
        if points.shape[1] == 1:  # a control that is held: the rate at the middle stands for the interval
            tau = self.grid.nodes[:-1] + 0.5 * widths
            rates = np.diff(self.x, axis=0) / (widths[:, None] * self.duration)
        else:
            own = np.broadcast_to(np.arange(points.shape[1]) < point_counts(self.scheme)[:, None], self.rates.shape[:2])
            own = own & (np.arange(points.shape[1]) < points.shape[1] - int(self.scheme.shared))
            tau = (self.grid.nodes[:-1, None] + points * widths[:, None])[own]
            rates = self.rates[own]
            if self.scheme.shared:
                tau, rates = np.append(tau, 1.0), np.vstack([rates, self.rates[-1, -1]])
        return CubicSpline(tau, rates * self.duration / self.problem.state_scale, axis=0)

    def with_replay(self, replay: ReplayResult, errors: Array | None, replay_ms: float) -> Solution:
        """Return the solution with its replay and the ``interval_errors`` (N - 1,), which took ``replay_ms`` [ms]."""
        timing = self.timing + Timing(replay_ms=replay_ms)
        return dataclasses.replace(self, replay=replay, interval_errors=errors, timing=timing)

    def save(self, path: str | Path) -> Path:
        """Write the solution to a file, whole or not at all, for ``load_solution``; returns its path.

        An .npz archive of numbers and texts, with the problem's functions as lists of elementary operations. OSError
        names the file where it cannot be written.
        """
        content = io.BytesIO()
        arrays = {"format": np.array(FORMAT)} | encoded(self, RECORD)
        np.savez_compressed(content, allow_pickle=False, **arrays)
        write_bytes(Path(path), content.getvalue())
        return Path(path)

    def plot(self, *names: str, path: str | Path | None = None) -> Figure:
        """Draw states, controls and path constraints with their multipliers, the Hamiltonian and the mesh.

        Args:
            names: names of what is drawn; everything if not given.
            path: file that the figure is written to, .png, .svg or .pdf; no file if not given.

        Returns:
            matplotlib's figure, on white.

        Raises:
            KeyError: for a name that is not a state, control or path constraint.
            ValueError: for a file of another kind.
        """
        from mathnavi.controllers.ocp.figure import solution_figure, written  # matplotlib takes a while to import

        known = (*self.problem.states, *self.problem.controls, *self.multipliers.path.names)
        chosen: list[str] = []
        for name in names:
            column = column_of(name, known)
            if column is None:
                raise KeyError(f"{name!r} is not a state, control or path constraint; {allowed_for(name, known)}")
            chosen += [known[k] for k in ([column] if isinstance(column, int) else column)]
        figure = solution_figure(self, chosen)
        if path is not None:
            write_bytes(Path(path), written(figure, Path(path).suffix))
        return figure

    def _locate(self, times: Array) -> tuple[Integers, Array]:
        """Interval and fraction in it of each time, held to [0, T]."""
        t = self.t
        interval: Integers = np.clip(np.searchsorted(t, times, side="right") - 1, 0, self.nodes - 2).astype(np.int64)
        fraction = np.clip((times - t[interval]) / np.diff(t)[interval], 0.0, 1.0)
        return interval, fraction


def along(problem: ProblemFunctions, x: Array, u: Array, t: Array, p: Array) -> Array:
    """Rates f(x, u, t; p) (n, nx) at states (n, nx), controls (n, nu) and times (n,) [s], parameters p (np,)."""
    mapped = problem.dynamics.map(len(t))
    rates = mapped(x.T, u.T, t[None, :], np.tile(p[:, None], (1, len(t))))
    return np.array(rates.full().T)
