"""What is compiled ahead of a flight is what the flight then calls."""

from __future__ import annotations

from numba.core import types
from numba.core.registry import cpu_target

from mathnavi.controllers.flight.ahead import DATA, KERNELS, ONE, PROGRAMME
from mathnavi.controllers.flight.held_input import _lag_along
from mathnavi.controllers.flight.kernels.linearisation import linearise
from mathnavi.controllers.flight.tracker import tracking_command
from mathnavi.models.terrain.kernels import path_clearance
from tests.kernels import flight


def test_a_flight_compiles_none_of_it_again() -> None:
    flight()
    known, quadratic = (types.Tuple(each.types) for each in (DATA, PROGRAMME))
    assert (ONE, known, ONE, ONE, quadratic) in linearise.signatures
    arguments = dict(KERNELS)
    assert all(arguments[kernel] in kernel.signatures for kernel in (path_clearance, _lag_along, tracking_command))
    codegen = cpu_target.target_context.codegen()  # what only other kernels call has no signature here, but a file
    assert all(kernel._cache._file(called_with, codegen).exists() for kernel, called_with in KERNELS)
