"""Optimal control problems whose optima are known: each with the value, its source, and the expected accuracy.

Every value is computed by two independent methods that agree to 1e-7, ``python -m benchmarks.ocp_references`` prints
both: published values that they contradict are not here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

from mathnavi.controllers.ocp.compiled_statement import KNOWN
from mathnavi.controllers.ocp.problem import OptimalControlProblem as OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.articles import (
    cart_pole,
    double_integrator_energy,
    double_integrator_time,
    fishing,
    linear_hypersensitive,
    singular_regulator,
    stirred_tank,
    target_line,
    van_der_pol_time,
)
from mathnavi.controllers.ocp.problems.betts import alp_rider, free_flying_robot, rayleigh, tumour
from mathnavi.controllers.ocp.problems.bryson_ho import bryson_denham, maximum_range, orbit_raising, steering, zermelo
from mathnavi.controllers.ocp.problems.cops import catalyst_mixing, goddard, hang_glider, hanging_chain, robot_arm
from mathnavi.controllers.ocp.problems.manuals import (
    brachistochrone,
    brachistochrone_drop,
    bunt,
    container_crane,
    hypersensitive,
    hypersensitive_short,
    lander,
    lunar_landing,
    moving_wall,
    two_link_arm,
    van_der_pol,
)
from mathnavi.controllers.ocp.problems.missile import OPTIMA, missile

Kind = Literal["smooth", "bang-bang", "singular", "state-constrained"]
"""kind of control: smooth; at its bounds but for instants; with a singular arc; with an arc on a path constraint"""


@dataclass(frozen=True)
class KnownOptimum:
    """A problem and the least J, as a value of what is compared."""

    problem: Callable[[], ProblemFunctions]
    optimum: float  # of the quantity
    source: str
    kind: Kind
    quantity: str = "J"
    tolerance: float = 1e-4  # relative error expected of a method with few nodes
    sign: float = 1.0  # J over the quantity: -1 where that is to be greatest
    origin: float = 0.0  # of the quantity, where what matters is the distance from it

    @property
    def precision(self) -> float:
        """Relative error within which an automatic solution is right: 1e-6, and 1e-5 where the control is singular."""
        return 1e-5 if self.kind == "singular" else 1e-6

    def value(self, cost: float) -> float:
        """The quantity at a cost J."""
        return self.sign * cost

    def error(self, cost: float) -> float:
        """|quantity - optimum|, relative to the optimum's distance from the origin."""
        return abs(self.value(cost) - self.optimum) / abs(self.optimum - self.origin)


PROBLEMS: dict[str, KnownOptimum] = {
    "brachistochrone": KnownOptimum(brachistochrone, 0.82475914315, "PSOPT manual", "smooth", "T"),
    "brachistochrone, g = 9.81": KnownOptimum(
        partial(brachistochrone, 9.81), 0.82433866944, "GPOPS-II manual", "smooth", "T"
    ),
    "brachistochrone, drop": KnownOptimum(brachistochrone_drop, 1.8016031225, "dymos documentation", "smooth", "T"),
    "Bryson-Denham": KnownOptimum(bryson_denham, 4.0, "4 / (9 L), Bryson and Ho", "state-constrained"),
    "Bryson-Denham, L = 0.1": KnownOptimum(
        partial(bryson_denham, 0.1), 4.4444444444, "4 / (9 L), Bryson and Ho", "state-constrained"
    ),
    "hypersensitive": KnownOptimum(hypersensitive, 3.3620569049, "exact for large T; GPOPS-II manual", "smooth"),
    "hypersensitive, short": KnownOptimum(hypersensitive_short, 1.3308069049, "exact", "smooth"),
    "linear hypersensitive": KnownOptimum(linear_hypersensitive, 1.6730939784, "Rao and Mease", "smooth"),
    "double integrator, energy": KnownOptimum(double_integrator_energy, 6.0, "analytic", "smooth"),
    "double integrator, energy, v(T) free": KnownOptimum(
        partial(double_integrator_energy, False), 1.5, "analytic", "smooth"
    ),
    "double integrator, time": KnownOptimum(double_integrator_time, 3.4641016151, "2 √3, analytic", "bang-bang", "T"),
    "target line": KnownOptimum(target_line, 0.21428571429, "3 / 14, Locatelli", "smooth"),
    "steering": KnownOptimum(steering, 0.55457087833, "Bryson and Ho; COPS 3", "smooth", "T"),
    "Zermelo": KnownOptimum(zermelo, 5.4578652636, "Bryson and Ho", "smooth", "T"),
    "maximum range": KnownOptimum(maximum_range, 1.7123148751, "Bryson; PSOPT manual", "smooth", "x(T)", sign=-1.0),
    "lunar landing": KnownOptimum(lunar_landing, 8.2462112512, "2 √17, Meditch", "bang-bang"),
    "lander": KnownOptimum(lander, 1.4203125990, "PSOPT manual", "bang-bang"),
    "orbit raising": KnownOptimum(orbit_raising, 1.5252777007, "Bryson and Ho", "smooth", "r(T)", sign=-1.0),
    "Goddard": KnownOptimum(
        goddard, 1.0128369183, "Pontryagin; COPS 3 prints 1.01283", "singular", "h(T)", sign=-1.0, origin=1.0
    ),
    "catalyst mixing": KnownOptimum(catalyst_mixing, -0.048055685861, "COPS 3", "singular"),
    "container crane": KnownOptimum(container_crane, 5.1503848e-3, "Sakawa and Shindo; PSOPT manual", "singular"),
    "robot arm": KnownOptimum(robot_arm, 9.1409117459, "COPS 3", "bang-bang", "T"),
    "bunt": KnownOptimum(bunt, 40.911939072, "Subchan and Zbikowski; PSOPT manual", "state-constrained", "T"),
    "stc1": KnownOptimum(moving_wall, 0.16982053634, "Jacobson and Lele; PSOPT manual", "state-constrained"),
    "two-link arm": KnownOptimum(two_link_arm, 2.9822799425, "Luus; PSOPT manual", "bang-bang", "T"),
    "van der Pol, time": KnownOptimum(van_der_pol_time, 1.2540747293, "Maurer et al.", "bang-bang", "T"),
    "singular regulator": KnownOptimum(singular_regulator, 0.75398386058, "Bell and Jacobson", "singular"),
    "fishing": KnownOptimum(fishing, 1.3440811995, "Sager", "singular"),
    "stirred tank": KnownOptimum(stirred_tank, 0.13309573050, "Lapidus and Luus", "smooth"),
    "hanging chain": KnownOptimum(hanging_chain, 5.0684801110, "COPS 3", "smooth"),
    "hang glider": KnownOptimum(hang_glider, 1248.031025, "Bulirsch et al.; COPS 3", "smooth", "x(T)", sign=-1.0),
    "van der Pol": KnownOptimum(van_der_pol, 3.1749818268, "JModelica, which prints 3.1761958", "smooth"),
    "Rayleigh": KnownOptimum(rayleigh, 44.804444893, "SOS", "state-constrained"),
    "cart-pole": KnownOptimum(cart_pole, 57.944780346, "Kelly 2017, a lower minimum", "smooth"),
    "tumour": KnownOptimum(tumour, 7571.6700384, "GPOPS-II manual, SOS", "bang-bang", "p(T)", tolerance=1e-3),
    "free-flying robot": KnownOptimum(free_flying_robot, 7.6886190934, "SOS, a lower minimum", "singular"),
    "alp rider": KnownOptimum(alp_rider, 2030.8543285, "Betts", "state-constrained", tolerance=1e-3),
}
"""problems of the literature by name"""

KNOWN.update({name: known.problem for name, known in PROBLEMS.items()})  # to be solved by their names

MISSILES: dict[str, KnownOptimum] = {
    f"missile, {name}": KnownOptimum(partial(missile, name), optimum.cost, "computed, two discretisations", "smooth")
    for name, optimum in OPTIMA.items()
}
"""cases of the thesis' design study (B.4), whose objective the thesis leaves open"""
