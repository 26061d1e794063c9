"""A problem transcribed by multiple shooting and solved again and again while time passes.

Each solve starts from the last solution, shifted by time: the nodes lie at other times than before, the states are read
off in between, and a control is the mean of what was held over its new interval. A shift by index would be wrong, for
the interval between two plans is not that between two nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.ocp.backend import Backend, Options
from mathnavi.controllers.ocp.distribution import NodeDistribution, constants_guess
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.controllers.ocp.solver import FIXED, transcription
from mathnavi.controllers.ocp.transcriptions.low_order import MultipleShooting
from mathnavi.interfaces.signals import Array

TOLERANCE = 1e-6
"""tolerance of the scaled optimality conditions: a tenth of a millimetre at the target"""
ITERATIONS, FIRST_ITERATIONS = 20, 100
"""largest number of iterations of a solve: from the last solution it takes 3 to 10, from a first guess 10 to 50"""
SECONDS, FIRST_SECONDS = 0.5, 10.0
"""CPU time [s] after which a solve is ended: from the last solution it takes some milliseconds"""

CLOCK = "T"
"""name of a last state that is the final time of a problem in τ = t / T"""


@dataclass(frozen=True, eq=False)
class Solved:
    """States x (N, nx) at the nodes, controls u (N - 1, nu) held between them, nodes (N,) as fractions of T [s].

    ``constants`` (c,) are those of the distribution of nodes.
    """

    x: Array
    u: Array
    nodes: Array
    duration: float
    constants: Array
    cost: float
    iterations: int

    @property
    def times(self) -> Array:
        """Times (N,) [s] of the nodes since the start."""
        return self.nodes * self.duration

    def after(self, shift: float) -> Solved:
        """Rest of the solution after ``shift`` [s], on the same number of nodes, with the same distribution."""
        index = np.arange(len(self.nodes), dtype=float)
        first = float(np.interp(shift, self.times, index))
        fractions = np.interp(np.linspace(first, index[-1], len(index)), index, self.nodes)
        fractions[0] = shift / self.duration
        at = fractions * self.duration
        left = self.duration - shift
        return Solved(
            x=np.column_stack([np.interp(at, self.times, column) for column in self.x.T]),
            u=mean_between(self.times, self.u, at),
            nodes=(at - shift) / left,
            duration=left,
            constants=self.constants * (1.0 - first / index[-1]),  # shares of the monitor function
            cost=self.cost,
            iterations=0,
        )


@dataclass(frozen=True)
class Failed:
    """A failed solve, with the reason."""

    message: str
    infeasible: bool


class Shooting:
    """A problem with its transcription; ``steps`` Runge-Kutta steps between two nodes.

    The final time of a solution is the problem's own or, where its last state is the ``CLOCK``, that state: such a
    problem runs from 0 to 1. Otherwise it is known, and the guess's.

    ``backend`` solves from the last solution. From a first guess it is IPOPT, which is sturdier there and says so where
    there is no solution. A solve that has not returned within ``SECONDS`` or ``FIRST_SECONDS`` is ended, and fails.
    """

    def __init__(
        self,
        problem: ProblemFunctions,
        nodes: int,
        backend: Backend,
        distribution: NodeDistribution = FIXED,
        steps: int = 2,
    ) -> None:
        first: Backend = "ipopt-compiled" if backend == "ipopt-compiled" else "ipopt"
        scheme = MultipleShooting(steps)
        again = Options(backend, TOLERANCE, ITERATIONS, SECONDS, warm=True)
        self._again = transcription(problem, scheme, nodes, distribution, again)
        sturdy = Options(first, TOLERANCE, FIRST_ITERATIONS, FIRST_SECONDS)
        self._first = transcription(problem, scheme, nodes, distribution, sturdy)
        self._size = problem.nx - (CLOCK in problem.states)
        self._timed = problem.free_duration or CLOCK in problem.states

    def solve(self, guess: Solved, parameters: Array, *, first: bool = False) -> Solved | Failed:
        """Solve for the parameters (np,) from the last solution or from a ``first`` guess, which gives a fixed grid."""
        transcribed = self._first if first else self._again
        layout, count, nx, nu = transcribed.layout, transcribed.nodes - 1, self._size, transcribed.problem.nu
        widths = np.diff(guess.nodes) * count
        z, w = [guess.x], [guess.u]
        if self._timed:
            z.append(np.full((count + 1, 1), guess.duration))
        z.append(np.tile(self._constants(guess), (count + 1, 1)))
        if layout.moving:
            z.append(guess.nodes[:, None])
            w.append(widths[:, None])
        known = parameters if layout.moving else np.concatenate([parameters, widths])
        answer = transcribed.solver.solve(layout.join(np.hstack(z), np.hstack(w), np.empty(0)), known)
        if not answer.ok:
            reason = f"{answer.status.value} ({answer.message}) after {answer.iterations} iterations"
            return Failed(reason, answer.status is SolverOutcome.NO_FEASIBLE_POINT)
        states, inputs, _ = layout.split(answer.x)
        constants = nx + int(self._timed)
        nodes = guess.nodes
        if layout.moving:
            nodes = np.concatenate([[0.0], np.cumsum(inputs[:, -1]) / inputs[:, -1].sum()])
        return Solved(
            states[:, :nx],
            inputs[:, :nu],
            nodes,
            float(states[0, nx]) if self._timed else guess.duration,
            states[0, constants : constants + layout.constants],
            answer.cost,
            answer.iterations,
        )

    def _constants(self, guess: Solved) -> Array:
        """Constants (c,) of the distribution of nodes; computed for a first guess, which lacks them."""
        distribution, problem = self._again.distribution, self._again.problem
        if len(guess.constants) == distribution.constants:
            return guess.constants
        chords = np.diff(guess.x, axis=0) / problem.state_scale[: self._size]
        widths = np.diff(guess.nodes) * (len(guess.nodes) - 1)
        return constants_guess(distribution, widths, guess.duration, chords, np.zeros_like(chords))


def mean_between(breaks: Array, held: Array, at: Array) -> Array:
    """Means (n - 1, m) over each [at_i, at_i+1] of values (k, m) held between ``breaks`` (k + 1,).

    Before the first break and after the last the nearest value is held on.
    """
    total = np.vstack([np.zeros(held.shape[1]), np.cumsum(held * np.diff(breaks)[:, None], axis=0)])
    inside = np.clip(at, breaks[0], breaks[-1])
    integral = np.column_stack([np.interp(inside, breaks, column) for column in total.T])
    integral += np.where(at < breaks[0], at - breaks[0], 0.0)[:, None] * held[0]
    integral += np.where(at > breaks[-1], at - breaks[-1], 0.0)[:, None] * held[-1]
    means: Array = np.diff(integral, axis=0) / np.diff(at)[:, None]
    return means
