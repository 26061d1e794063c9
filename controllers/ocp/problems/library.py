"""Optimal control problems whose optima are known: each with the value, its source, and how near one should come.

The values were computed again with an independent Radau collocation code; published ones that it contradicts are not
here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from mathnavi.controllers.ocp.problem import KNOWN
from mathnavi.controllers.ocp.problem import OptimalControlProblem as OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.alp_rider import alp_rider
from mathnavi.controllers.ocp.problems.brachistochrone import brachistochrone, brachistochrone_drop
from mathnavi.controllers.ocp.problems.bryson_denham import bryson_denham
from mathnavi.controllers.ocp.problems.cart_pole import cart_pole
from mathnavi.controllers.ocp.problems.double_integrator import double_integrator_energy, double_integrator_time
from mathnavi.controllers.ocp.problems.free_flying_robot import free_flying_robot
from mathnavi.controllers.ocp.problems.goddard import goddard
from mathnavi.controllers.ocp.problems.hypersensitive import hypersensitive, hypersensitive_short
from mathnavi.controllers.ocp.problems.missile import OPTIMA, missile
from mathnavi.controllers.ocp.problems.rayleigh import rayleigh
from mathnavi.controllers.ocp.problems.tumour import tumour
from mathnavi.controllers.ocp.problems.van_der_pol import van_der_pol


@dataclass(frozen=True)
class KnownOptimum:
    """A problem and the least J, as a value of what is compared."""

    problem: Callable[[], ProblemFunctions]
    optimum: float  # of the quantity
    source: str
    quantity: str = "J"
    tolerance: float = 1e-4  # relative: how near one should come
    sign: float = 1.0  # J over the quantity: -1 where that is to be greatest
    origin: float = 0.0  # of the quantity, where what matters is the distance from it

    def value(self, cost: float) -> float:
        """The quantity at a cost J."""
        return self.sign * cost

    def error(self, cost: float) -> float:
        """|quantity - optimum|, relative to the optimum's distance from the origin."""
        return abs(self.value(cost) - self.optimum) / abs(self.optimum - self.origin)


PROBLEMS: dict[str, KnownOptimum] = {
    "brachistochrone": KnownOptimum(brachistochrone, 0.8247591, "PSOPT manual", "T"),
    "brachistochrone, g = 9.81": KnownOptimum(partial(brachistochrone, 9.81), 0.8243387, "GPOPS-II manual", "T"),
    "brachistochrone, drop": KnownOptimum(brachistochrone_drop, 1.8016031, "dymos documentation", "T"),
    "Bryson-Denham": KnownOptimum(bryson_denham, 4.0, "4 / (9 L), Bryson and Ho"),
    "hypersensitive": KnownOptimum(hypersensitive, 3.3620571, "exact for large T; GPOPS-II manual"),
    "hypersensitive, short": KnownOptimum(hypersensitive_short, 1.3308069, "exact"),
    "double integrator, energy": KnownOptimum(double_integrator_energy, 6.0, "analytic"),
    "double integrator, energy, v(T) free": KnownOptimum(partial(double_integrator_energy, False), 1.5, "analytic"),
    "double integrator, time": KnownOptimum(double_integrator_time, 3.4641016, "2 √3, analytic", "T"),
    "Goddard": KnownOptimum(goddard, 1.0128369, "Pontryagin; COPS 3 prints 1.01283", "h(T)", sign=-1.0, origin=1.0),
    "van der Pol": KnownOptimum(van_der_pol, 3.1749892, "dense grid; JModelica prints 3.1761958"),
    "Rayleigh": KnownOptimum(rayleigh, 44.804444, "SOS"),
    "cart-pole": KnownOptimum(cart_pole, 58.808, "Kelly 2017"),
    "tumour": KnownOptimum(tumour, 7571.6784, "GPOPS-II manual, SOS", "p(T)", tolerance=1e-3),
    "free-flying robot": KnownOptimum(free_flying_robot, 7.910155, "SOS"),
    "alp rider": KnownOptimum(alp_rider, 2030.8559, "Betts", tolerance=1e-3),
}
"""the problems of the literature by name"""

KNOWN.update({name: known.problem for name, known in PROBLEMS.items()})  # to be solved by their names

MISSILES: dict[str, KnownOptimum] = {
    f"missile, {name}": KnownOptimum(partial(missile, name), optimum.cost, "independent code, N = 301")
    for name, optimum in OPTIMA.items()
}
"""the thesis' own design study (B.4), whose objective the thesis leaves open"""
