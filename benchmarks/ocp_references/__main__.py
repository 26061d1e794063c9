"""The known optima of the library, each computed again by two independent methods.

    python -m benchmarks.ocp_references [--problems NAME NAME ...]
    python -m benchmarks.ocp_references --published all|NAME NAME ... [--intervals 60] [--degree 5]

A problem with a closed-form solution is computed from that and by collocation with Radau IIA, any other by Radau IIA
and by Gauss-Legendre, whose points and degrees differ. The exit code is 1 unless both methods and the library agree to
1e-7, relative to the optimum's distance from its origin. ``--published`` does the same for published problems
(``benchmarks.ocp_references.published``).

Optima that are known in closed form, or up to a quadrature or a root.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from rich.console import Console
from rich.table import Table
from scipy.integrate import quad
from scipy.optimize import brentq

from benchmarks.arguments import read_arguments
from benchmarks.comparison import WIDTH
from benchmarks.ocp_references.chains import CHAINS
from benchmarks.ocp_references.collocation import gauss, radau
from benchmarks.ocp_references.phases import Mesh
from benchmarks.ocp_references.published import compare
from mathnavi.controllers.ocp.problems.library import MISSILES, PROBLEMS, KnownOptimum
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import TOGETHER
from mathnavi.studies.published.library import PUBLISHED


def cycloid(across: float, drop: float, gravity: float) -> float:
    """Return the time of the brachistochrone x = a (φ - sin φ), y = a (1 - cos φ): φ sqrt(a / g)."""
    phi = brentq(lambda p: across * (1.0 - math.cos(p)) - drop * (p - math.sin(p)), 0.1, 6.2, xtol=1e-14)
    return float(phi * math.sqrt(drop / (1.0 - math.cos(phi)) / gravity))


def boundary_layers(start: float, end: float) -> float:
    """Return J of the long hypersensitive problem, S(start, -1) + S(end, 1), S(a, ±1) = ∫_0^a x √(x^4 + 1) ± x^3 dx."""

    def layer(a: float, sign: float) -> float:
        return float(quad(lambda x: x * math.sqrt(x**4 + 1.0) + sign * x**3, 0.0, a, epsabs=1e-13)[0])

    return layer(start, -1.0) + layer(end, 1.0)


def linear_layers(start: float, end: float, duration: float) -> float:
    """Return J of the linear hypersensitive problem: x = A e^(√2 t) + B e^(-√2 t), u = -λ, J = -λ x / 2 at the ends."""
    s = math.sqrt(2.0)
    A, B = np.linalg.solve(
        [[math.exp(-s * duration), 1.0], [1.0, math.exp(-s * duration)]], [start, end]
    )  # A belongs to e^(√2 (t - T))
    decay = math.exp(-s * duration)
    u_start = (1.0 + s) * A * decay + (1.0 - s) * B
    u_end = (1.0 + s) * A + (1.0 - s) * B * decay
    return float((u_end * end - u_start * start) / 2.0)


def resting_on_the_wall(wall: float) -> float:
    """Return J of the Bryson-Denham problem for state bounds L up to 1/6: 4 / (9 L)."""
    return 4.0 / (9.0 * wall)


def fall_and_brake(height: float, speed: float, gravity: float, thrust: float) -> float:
    """Return the fuel of a soft landing that falls and then brakes: thrust times the time of braking from the switch.

    v_s^2 = v^2 + 2 g (h - h_s) and v_s^2 = 2 (F - g) h_s.
    """
    switch = math.sqrt((thrust - gravity) / thrust * (speed**2 + 2.0 * gravity * height))
    return thrust * switch / (thrust - gravity)


def catenary(length: float, start: float, end: float) -> float:
    """Return the energy ∫ x ds of a hanging chain x = c + a cosh((t - b) / a) over a distance of 1."""
    a = brentq(
        lambda a: 2.0 * a * math.sinh(0.5 / a) - math.sqrt(length**2 - (end - start) ** 2), 0.05, 10.0, xtol=1e-15
    )
    b = 0.5 - a * math.atanh((end - start) / length)
    c = start - a * math.cosh(-b / a)
    energy, _ = quad(lambda t: (c + a * math.cosh((t - b) / a)) * math.cosh((t - b) / a), 0.0, 1.0, epsabs=1e-13)
    return float(energy)


CLOSED_FORMS: dict[str, Callable[[], float]] = {
    "brachistochrone": lambda: cycloid(2.0, 2.0, 9.8),
    "brachistochrone, g = 9.81": lambda: cycloid(2.0, 2.0, 9.81),
    "brachistochrone, drop": lambda: cycloid(10.0, 5.0, 9.80665),
    "Bryson-Denham": lambda: resting_on_the_wall(1.0 / 9.0),
    "Bryson-Denham, L = 0.1": lambda: resting_on_the_wall(0.1),
    "hypersensitive": lambda: boundary_layers(1.0, 1.5),
    "hypersensitive, short": lambda: boundary_layers(1.5, 1.0),
    "linear hypersensitive": lambda: linear_layers(1.5, 1.0, 10.0),
    "double integrator, energy": lambda: 6.0,
    "double integrator, energy, v(T) free": lambda: 1.5,
    "double integrator, time": lambda: 2.0 * math.sqrt(3.0),
    "target line": lambda: 3.0 / 14.0,
    "lunar landing": lambda: fall_and_brake(10.0, -2.0, 1.5, 3.0),
    "hanging chain": lambda: catenary(4.0, 1.0, 3.0),
}
"""function that returns the known quantity, by the problem's name"""


AGREEMENT = 1e-7
KNOWN = PROBLEMS | MISSILES


@configuration
class Arguments:
    """Compute the known optima of the library by two independent methods."""

    problems: Annotated[tuple[str, ...], TOGETHER] = tuple(CHAINS)
    """names of the problems"""
    published: Annotated[tuple[str, ...], TOGETHER] = ()
    """names of published problems instead, or all"""
    intervals: Annotated[int, Within(Ge(1), allowed=">= 1")] = 60
    """number of intervals of each phase of a published problem"""
    degree: Annotated[int, Within(Ge(1), Le(12), allowed="1 to 12")] = 5
    """number of points of an interval of a published problem"""
    control_degree: Annotated[int, Within(Ge(-1), Le(11), allowed="-1 to 11")] = -1
    """degree of the controls of a published problem in an interval; -1: a value at each point"""
    moving: bool = False
    """whether the widths of the intervals are unknowns, for controls of a lower degree"""
    from_solve: bool = False
    """whether a published problem starts from the answer of solve()"""

    def __post_init__(self) -> None:
        if self.moving and self.control_degree < 0:
            raise FieldError("moving = True, control_degree = -1; allowed: control_degree >= 0, or nothing that moves")
        for name in self.published:
            if name != "all" and name not in PUBLISHED:
                raise FieldError(f"published: {name!r}; {allowed_for(name, list(PUBLISHED))}")
        for name in self.problems:
            if name not in CHAINS:
                raise FieldError(f"problems: {name!r}; {allowed_for(name, list(CHAINS))}")


@dataclass(frozen=True)
class Agreement:
    """Two computations of one optimum, and the library's value."""

    name: str
    methods: tuple[str, str]
    values: tuple[float, float]

    @property
    def known(self) -> KnownOptimum:
        """Entry of the library."""
        return KNOWN[self.name]

    @property
    def difference(self) -> float:
        """Absolute difference of both values, relative to the optimum's distance from its origin."""
        return abs(self.values[0] - self.values[1]) / abs(self.known.optimum - self.known.origin)

    @property
    def error(self) -> float:
        """Error of the library, relative to the optimum's distance from its origin: the larger one of both methods."""
        return max(self.known.error(self.known.sign * value) for value in self.values)

    @property
    def holds(self) -> bool:
        """True if both and the library agree to 1e-7."""
        return max(self.difference, self.error) <= AGREEMENT


def agreement(name: str) -> Agreement:
    """Compute an optimum by both methods; NoReferenceError if one does not converge."""
    known, chain = KNOWN[name], CHAINS[name]
    problem = known.problem()
    guess = chain.guess(problem)
    by_radau = known.value(chain.optimum(problem, radau(chain.radau), guess))
    if name in CLOSED_FORMS:
        return Agreement(name, ("on paper", "Radau IIA"), (CLOSED_FORMS[name](), by_radau))
    by_gauss = known.value(chain.optimum(problem, gauss(chain.gauss), guess))
    return Agreement(name, ("Radau IIA", "Gauss"), (by_radau, by_gauss))


def main(arguments: Arguments) -> int:
    """Print the table; returns the exit code."""
    console = Console(width=WIDTH)
    if arguments.published:
        degree = None if arguments.control_degree < 0 else arguments.control_degree
        mesh = Mesh(arguments.intervals, arguments.degree, degree, arguments.moving)
        chosen = list(PUBLISHED) if "all" in arguments.published else list(arguments.published)
        return compare(chosen, mesh, console, from_solve=arguments.from_solve)
    table = Table(title="Known optima, computed twice")
    for heading in ("problem", "by", "value", "by", "value", "difference", "library"):
        table.add_column(heading, justify="left" if heading in ("problem", "by") else "right", no_wrap=True)
    found = []
    for name in arguments.problems:
        each = agreement(name)
        found.append(each)
        (first, second), (a, b) = each.methods, each.values
        table.add_row(name, first, f"{a:.10g}", second, f"{b:.10g}", f"{each.difference:.0e}", f"{each.error:.0e}")
    console.print(table)
    if failed := [each.name for each in found if not each.holds]:
        console.print(f"They do not agree to {AGREEMENT:g}: {', '.join(failed)}", markup=False)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(read_arguments(Arguments)))
