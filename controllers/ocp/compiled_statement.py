"""The compiled functions of a statement, kept until something else is stated."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from mathnavi.controllers.ocp.breaks import fractions, times_of
from mathnavi.controllers.ocp.guesses import Sampled
from mathnavi.controllers.ocp.lowering import functions_of
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.statement import Statement
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ProblemError

KNOWN: dict[str, Callable[[], ProblemFunctions]] = {}
"""problems with a known optimum by name, filled by ``mathnavi.controllers.ocp.problems.library``"""


class CompiledStatement:
    """A statement's functions, compiled when they are first asked for, and those with further break times."""

    def __init__(self, statement: Statement) -> None:
        """Take a statement, which may be added to later."""
        self._statement = statement
        self._compiled: tuple[list[object], ProblemFunctions] | None = None
        self._broken: tuple[ProblemFunctions, ProblemFunctions] | None = None

    def functions(self) -> ProblemFunctions:
        """Compile and check the functions, or return those that are kept.

        Raises ProblemError, with the name of what is missing or contradicts itself.
        """
        if not self._statement.states:
            return self._of_the_literature()
        parts = self._statement.parts
        if self._compiled is None or not _same(parts, self._compiled[0]):
            self._compiled = parts, functions_of(self._statement)
        return self._compiled[1]

    def with_breaks(
        self, problem: ProblemFunctions, breaks: Sequence[float], method: str, *, whole: bool
    ) -> ProblemFunctions:
        """Return a compiled problem with break times [s] in addition to its own; kept unchanged.

        ``whole`` is True if all but the method is left to the method. ProblemError for times outside of the duration,
        and for a method that cannot hold them.
        """
        given = times_of(problem.name, breaks, problem.duration_bounds[1])
        if not given:
            return problem
        if problem.free_duration:
            if method != "auto" or not whole:
                raise ProblemError(
                    f"{problem.name}: breaks where the duration is free; allowed: method = 'auto' without nodes, "
                    "scheme and monitor, which holds a node at each, or a duration that is fixed"
                )
            times = tuple(sorted(set(given)))
            if self._broken is None or self._broken[0] is not problem or self._broken[1].break_times != times:
                self._broken = problem, dataclasses.replace(problem, break_times=times)
            return self._broken[1]
        if method == "distribute":
            raise ProblemError(
                f"{problem.name}: breaks with method = 'distribute', whose nodes are unknowns; allowed: another method"
            )
        every = fractions(np.append(np.array(given) / problem.guess_duration, problem.breaks))
        if self._broken is None or self._broken[0] is not problem or self._broken[1].breaks != every:
            self._broken = problem, dataclasses.replace(problem, breaks=every)
        return self._broken[1]

    def _of_the_literature(self) -> ProblemFunctions:
        """The problem of the statement's name whose optimum is known."""
        name = self._statement.name
        if not KNOWN:
            raise ProblemError(f"{name}: no state is declared; allowed: at least one")
        if name not in KNOWN:
            known = allowed_for(name, list(KNOWN))
            raise ProblemError(f"{name}: no state is declared, and no problem with a known optimum; {known}")
        return KNOWN[name]()


def _same(parts: list[object], others: list[object]) -> bool:
    """True if nothing was stated in between; a guess that is a function may have changed its values."""
    if len(parts) != len(others) or any(isinstance(part, Sampled) for part in parts):
        return False
    return all(part is other for part, other in zip(parts, others, strict=True))
