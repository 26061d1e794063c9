"""Compiles kernels that a flight needs late, while the flight itself compiles those that it needs first.

    python -m mathnavi.controllers.flight.ahead

The two processes share what they have compiled through the folder of kernels (``mathnavi.sim.interfaces.compiled``).
The types are those of the arguments that a flight calls a kernel with: for others it would be compiled in vain.
"""

from __future__ import annotations

from typing import Any

from numba import float64, int64
from numba.core import types

from mathnavi.controllers.flight.held_input import _lag_along
from mathnavi.controllers.flight.kernels.constraint_rows import ball_rows, clearance_rows, end_rows
from mathnavi.controllers.flight.kernels.convexity import add_curvature, convexify
from mathnavi.controllers.flight.kernels.problem_data import ProblemData, QuadraticProgramme
from mathnavi.controllers.flight.tracker import tracking_command
from mathnavi.models.terrain.kernels import path_clearance

_named: Any = types.NamedTuple  # which has no types itself


def _array(dimensions: int, readonly: bool = False) -> Any:
    return types.Array(float64, dimensions, "C", readonly)


ONE, TWO, THREE = (_array(dimensions) for dimensions in (1, 2, 3))
DATA = _named((ONE, ONE, ONE, TWO, ONE, TWO, TWO, THREE, ONE, ONE), ProblemData)
PROGRAMME = _named((TWO, ONE, TWO, ONE, ONE), QuadraticProgramme)
PLAN = (_array(1, readonly=True), _array(2, readonly=True), _array(2, readonly=True))  # times, states and inputs
KERNELS: tuple[tuple[Any, tuple[Any, ...]], ...] = (
    (ball_rows, (ONE, DATA, ONE, int64, PROGRAMME, THREE)),
    (end_rows, (ONE, DATA, ONE, int64, PROGRAMME)),
    (convexify, (TWO, TWO)),
    (clearance_rows, (ONE, DATA, PROGRAMME)),
    (add_curvature, (TWO, TWO, ONE, float64, TWO)),
    (path_clearance, (_array(2, readonly=True), float64, TWO, TWO, TWO, ONE)),
    (_lag_along, (*PLAN, float64, float64, float64, float64, ONE)),
    (tracking_command, (*PLAN, float64, float64, ONE, ONE, float64, float64)),
)
"""in the order in which they are compiled: those that take long and are needed soonest first"""


def main() -> None:
    """Compile them."""
    for kernel, arguments in KERNELS:
        kernel.compile(arguments)


if __name__ == "__main__":
    main()
