"""Starts of programmes, moved by some last digits: they stand for the rounding of other machines.

Of two processors one may start a solver some last digits beside the other. What a test or a page says of the solution
has to hold from there too: ``pytest --perturb SEED`` starts every programme so. Child processes of a test start theirs
as they are.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array

DEVIATION = 1e-15  # relative, of each unknown: some four units of its last place


def perturbed(start: Array, seed: int) -> Array:
    """Return ``start`` times 1 + 1e-15 N(0, 1), with noise that depends on the seed and on the start alone.

    So the same start is moved alike in every test, in any order of tests, and what is repeated gives the same.
    """
    noise = np.random.default_rng([seed, zlib.crc32(start.tobytes())]).standard_normal(start.shape)
    return start * (1.0 + DEVIATION * noise)


@contextmanager
def perturbed_starts(seed: int) -> Iterator[None]:
    """Move the start of every programme, whether CasADi's solvers or our sequential quadratic programming solve it."""
    from mathnavi.controllers.flight import as_printed
    from mathnavi.controllers.flight.sqp import CondensedSqp
    from mathnavi.models.nlp_solver import NlpSolver, Watch

    interior, condensed, printed = NlpSolver.solve, CondensedSqp.solve, as_printed.solve

    def solve(solver: NlpSolver, watch: Watch | None = None) -> Any:
        start = solver.inputs["x0"]
        given = start.copy()
        start[:] = perturbed(given, seed)
        try:
            return interior(solver, watch)
        finally:
            start[:] = given

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(NlpSolver, "solve", solve)
        patch.setattr(
            CondensedSqp, "solve", lambda self, problem, guess: condensed(self, problem, perturbed(guess, seed))
        )
        patch.setattr(as_printed, "solve", lambda nlp, guess: printed(nlp, perturbed(guess, seed)))
        yield
