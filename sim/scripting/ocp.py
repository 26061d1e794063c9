"""Optimal control problems, written down as on paper and solved in one call.

    minimise    J = ∫_0^T L(x, u, t; p) dt + Psi(x(T), T; p)
    subject to  x' = f(x, u, t; p),   d_lower <= d(x, u, t; p) <= d_upper,   and what holds at both ends

with states x, controls u and a final time T, fixed or free (``mathnavi.controllers.ocp.statement``).
"""

from __future__ import annotations

from collections.abc import Mapping

from mathnavi.controllers.ocp import statement
from mathnavi.controllers.ocp.methods.direct import solve
from mathnavi.controllers.ocp.methods.refinement import refine
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.sim.interfaces.checks import allowed_for
from mathnavi.sim.interfaces.errors import ProblemError
from mathnavi.sim.scripting.requests import raising

NODES = 40


class OptimalControlStatement(statement.Statement):
    """A problem that is stated call by call, and solved.

        ocp = OptimalControlProblem("Bryson-Denham")
        x, v, u = ocp.state("x", upper=1 / 9), ocp.state("v"), ocp.control("u", scale=5.0)
        ocp.duration(1.0)
        ocp.minimise(running=u**2 / 2)
        ocp.dynamics(x, v)
        ocp.dynamics(v, u)
        ocp.start(x, 0.0), ocp.start(v, 1.0), ocp.end(x, 0.0), ocp.end(v, -1.0)
        solution = ocp.solve()

    Symbols are CasADi's. A problem on which nothing is declared is the one of that name among those whose optimum is
    known (``mathnavi.controllers.ocp.problems.library``).
    """

    def solve(
        self,
        nodes: int = NODES,
        *,
        adaptive: bool = False,
        guess: Solution | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> Solution:
        """The solution on ``nodes`` uniform nodes by Hermite-Simpson collocation, flown again through its own dynamics.

        With ``adaptive`` nodes are added where the local error is, ``nodes`` at most. ``guess`` is a solution to begin
        with, ``parameters`` are values by name, the nominal ones where none is given. Whether there is a solution is in
        its ``status``: ``solution.ok``.

        Raises ProblemError for a statement that is not whole or contradicts itself, and for fewer than two nodes.
        """
        with raising(ProblemError):
            problem = self.problem()
            values = problem.values(**(parameters or {}))
            if adaptive:
                return refine(problem, min(6, nodes), most_nodes=nodes, guess=guess, parameters=values)
            return solve(problem, nodes, guess=guess, parameters=values)

    def problem(self) -> statement.OptimalControlProblem:
        """The finished problem, checked; errors as of ``solve``."""
        with raising(ProblemError):
            if self._states:
                return super().problem()
            if self.name not in PROBLEMS:
                known = allowed_for(self.name, list(PROBLEMS))
                raise ProblemError(f"{self.name}: no state is declared, and no problem with a known optimum; {known}")
            return PROBLEMS[self.name].problem()

    def __repr__(self) -> str:
        states, controls = ([each.name for each in declared] for declared in (self._states, self._controls))
        return f"OptimalControlProblem({self.name!r}, states {states}, controls {controls})"
