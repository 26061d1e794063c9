"""The kernels of a flight, compiled before it by two processes that share the work (``sim.engine.compilation``).

The types are those of the arguments that a flight calls a kernel with: for others it would be compiled in vain.
Kernels that share inner ones are neighbours.
"""

from __future__ import annotations

from typing import Any

from numba import float64, int64
from numba.core import types

from mathnavi.controllers.flight.certificate import _extent
from mathnavi.controllers.flight.held_input import _lag_along
from mathnavi.controllers.flight.kernels.line_search import begin, search
from mathnavi.controllers.flight.kernels.linearisation import linearise
from mathnavi.controllers.flight.length_to_go import cost_many
from mathnavi.controllers.flight.tracker import tracking_command
from mathnavi.models.aerial.kernels import state_on
from mathnavi.models.terrain.kernels import arc_clearance, path_clearance, surface
from mathnavi.sim.interfaces.compiled import Signature


def _array(dimensions: int, readonly: bool = False) -> Any:
    return types.Array(float64, dimensions, "C", readonly)


ONE, TWO, THREE = (_array(dimensions) for dimensions in (1, 2, 3))
_tuple: Any = types.Tuple  # which has no types itself
DATA = _tuple((ONE, ONE, ONE, TWO, ONE, TWO, TWO, THREE, ONE, ONE))  # ProblemData
PROGRAMME = _tuple((TWO, ONE, TWO, ONE, ONE))  # QuadraticProgramme
GROUND = (_array(2, readonly=True), float64)
PLAN = (_array(1, readonly=True), _array(2, readonly=True), _array(2, readonly=True))  # times, states and inputs
KERNELS: tuple[Signature, ...] = (
    (linearise, (ONE, DATA, ONE, ONE, PROGRAMME)),
    (begin, (ONE, DATA, ONE, ONE)),
    (search, (ONE, float64, float64, ONE, float64, int64, PROGRAMME, DATA, ONE, ONE)),
    (cost_many, (TWO, THREE, ONE, TWO)),
    (tracking_command, (*PLAN, float64, float64, ONE, ONE, float64, float64)),
    (state_on, (*PLAN, float64)),
    (_lag_along, (*PLAN, float64, float64, float64, float64, ONE)),
    (_extent, (ONE, ONE, ONE, ONE)),
    (surface, (*GROUND, ONE, ONE)),
    (path_clearance, (*GROUND, TWO, TWO, TWO, ONE)),
    (arc_clearance, (*GROUND, ONE, ONE, ONE, float64)),
)
