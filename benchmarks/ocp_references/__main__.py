"""The known optima of the library, each computed again by two independent methods.

    python -m benchmarks.ocp_references [--problems NAME NAME ...]

A problem with a solution on paper is computed from that and by collocation with Radau IIA, any other by Radau IIA and
by Gauss and Legendre, whose points and degrees differ. Exit code 1 unless both agree to 1e-7, and the library with
them, relative to the optimum's distance from its origin.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import tyro
from rich.console import Console
from rich.table import Table

from benchmarks.comparison import WIDTH
from benchmarks.ocp_references.chains import CHAINS
from benchmarks.ocp_references.closed_forms import CLOSED_FORMS
from benchmarks.ocp_references.collocation import gauss, radau
from mathnavi.controllers.ocp.problems.library import MISSILES, PROBLEMS, KnownOptimum
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import FieldError

AGREEMENT = 1e-7
KNOWN = PROBLEMS | MISSILES


@configuration
class Arguments:
    """Compute the known optima of the library by two independent methods."""

    problems: tuple[str, ...] = tuple(CHAINS)
    """names of the problems"""

    def __post_init__(self) -> None:
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
        """The library's entry."""
        return KNOWN[self.name]

    @property
    def difference(self) -> float:
        """|difference of both values|, relative to the optimum's distance from its origin."""
        return abs(self.values[0] - self.values[1]) / abs(self.known.optimum - self.known.origin)

    @property
    def error(self) -> float:
        """The library's error, relative in the same way, from the value that is farther."""
        return max(self.known.error(self.known.sign * value) for value in self.values)

    @property
    def holds(self) -> bool:
        """True if both and the library agree to 1e-7."""
        return max(self.difference, self.error) <= AGREEMENT


def agreement(name: str) -> Agreement:
    """Compute an optimum twice; NoReferenceError where a method does not converge."""
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
    sys.exit(main(tyro.cli(Arguments, description=Arguments.__doc__)))
