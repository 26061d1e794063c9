"""The kernels of a flight, compiled before it by two processes that share the work (``sim.engine.compilation``).

The types are those of the arguments that a flight calls a kernel with: for others the compilation would be of no use.
Kernels that share inner ones are neighbours. Linearisation takes half as long as all others together: one process
begins with it, the other with the line search at the other end of the list, and they meet among small kernels.
"""

from __future__ import annotations

from numba import float64, int64

from mathnavi.controllers.flight.certificate import _along_arcs, _extent
from mathnavi.controllers.flight.held_input import _lag_along
from mathnavi.controllers.flight.kernels.line_search import begin, search
from mathnavi.controllers.flight.kernels.linearisation import linearise
from mathnavi.controllers.flight.shortest_paths import _settle
from mathnavi.controllers.flight.spline import cost_many
from mathnavi.controllers.flight.tracker import tracking_command
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, ONE_READ, THREE, TWO, TWO_READ, array, combined
from mathnavi.models.aerial.kernels import offset_from, state_on
from mathnavi.models.terrain.kernels import arc_clearance, path_clearance, surface

DATA = combined(ONE, ONE, ONE, TWO, ONE, TWO, TWO, THREE, ONE, ONE)  # ProblemData
PROGRAMME = combined(TWO, ONE, TWO, ONE, ONE)  # QuadraticProgramme
GROUND = (TWO_READ, float64)
PLAN = (ONE_READ, TWO_READ, TWO_READ)  # times, states and inputs
WHOLE = array(1, int64)
LINEARISING: tuple[Signature, ...] = ((linearise, (ONE, DATA, ONE, ONE, PROGRAMME)),)
TRACKING: tuple[Signature, ...] = (
    (tracking_command, (*PLAN, float64, float64, ONE, ONE, float64, float64)),
    (_lag_along, (*PLAN, float64, float64, float64, float64, ONE)),
)
CERTIFYING: tuple[Signature, ...] = (
    (state_on, (*PLAN, float64)),
    (offset_from, (*PLAN, float64, ONE)),
    (_along_arcs, (ONE, TWO, TWO)),
    (_extent, (ONE, TWO, TWO, int64)),
    (surface, (*GROUND, ONE, ONE)),
    (path_clearance, (*GROUND, TWO, TWO, TWO, ONE)),
    (arc_clearance, (*GROUND, ONE, ONE, ONE, float64)),
)
SEARCHING: tuple[Signature, ...] = (
    (_settle, (ONE, ONE, ONE, WHOLE, WHOLE, float64, int64, int64, int64)),
    (cost_many, (TWO, THREE, ONE, TWO)),
    (begin, (ONE, DATA, ONE, ONE)),
    (search, (ONE, float64, float64, ONE, float64, int64, PROGRAMME, DATA, ONE, ONE)),
)
KERNELS = (*LINEARISING, *CERTIFYING, *TRACKING, *SEARCHING)
