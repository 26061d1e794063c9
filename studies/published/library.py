"""Published problems of all collections: each with what its collection prints, and which of them are the same problem.

The lists stand in a module for each source: ``psopt``, ``cops``, ``bocop`` and ``optimal_control_jl``. A problem that
is in several collections, or in ``mathnavi.controllers.ocp.problems.library`` too, is solved once, under the name of
the entry that states it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.studies.published import bocop, cops, optimal_control_jl, psopt
from mathnavi.studies.published.optimum import PublishedOptimum

COLLECTION = "collection: "
"""beginning of the names of the problems of ``controllers/ocp/problems``"""


def _of_the_collection(name: str) -> PublishedOptimum:
    known = PROBLEMS[name]
    return PublishedOptimum(
        value="",
        source=known.source,
        statement=partial(OptimalControlProblem, name),
        independent=known.optimum,
        evidence="two methods, benchmarks.ocp_references",
        quantity=known.quantity,
        sign=known.sign,
        origin=known.origin,
        singular=known.kind == "singular",
    )


OF_THE_COLLECTION: dict[str, PublishedOptimum] = {f"{COLLECTION}{name}": _of_the_collection(name) for name in PROBLEMS}
"""problems of ``controllers/ocp/problems``"""


def merged(*lists: Mapping[str, PublishedOptimum]) -> dict[str, PublishedOptimum]:
    """Join the lists of several sources; ValueError for a name that is in two of them."""
    found: dict[str, PublishedOptimum] = {}
    for each in lists:
        if twice := found.keys() & each.keys():
            raise ValueError(f"{', '.join(sorted(twice))}: in two lists; allowed: names that differ")
        found |= each
    return found


def stated_as(name: str, problems: Mapping[str, PublishedOptimum]) -> str:
    """Return the name of the entry that states a problem: its own, or that which ``same_as`` leads to.

    ValueError where ``same_as`` leads to no problem, or back to where it began.
    """
    passed = [name]
    while other := problems[passed[-1]].same_as:
        if other not in problems or other in passed:
            raise ValueError(f"{name}: same as {other!r}; allowed: another problem of the lists or of the collection")
        passed.append(other)
    return passed[-1]


PUBLISHED = merged(psopt.PUBLISHED, cops.PUBLISHED, bocop.PUBLISHED, optimal_control_jl.PUBLISHED)
"""problems of all sources, in the order of the sources"""
EVERY = merged(PUBLISHED, OF_THE_COLLECTION)
"""those and the problems of ``controllers/ocp/problems``"""
STATED_AS = {name: stated_as(name, EVERY) for name in EVERY}
"""name of the entry that states a problem, by the problem's name"""
DISTINCT = tuple(dict.fromkeys(STATED_AS[name] for name in PUBLISHED))
"""names of the entries that state the published problems, each problem once"""


def known_cost(name: str) -> float | None:
    """Return the optimal J of a problem by an independent computation, its own entry's or that which states it."""
    for entry in (EVERY[STATED_AS[name]], EVERY[name]):
        if entry.independent is not None:
            return entry.sign * entry.independent
    return None


def is_singular(name: str) -> bool:
    """Return True if an entry, or that which states its problem, says that the optimum has a singular arc."""
    return EVERY[name].singular or EVERY[STATED_AS[name]].singular


def precision(name: str) -> float:
    """Return the relative error within which J of a problem is right: 1e-6, and 1e-5 with a singular arc."""
    return 1e-5 if is_singular(name) else 1e-6


def relative_error(entry: PublishedOptimum, value: float, optimum: float) -> float:
    """Return |value - optimum| of an entry's quantity, relative to the optimum's distance from the origin.

    Absolute where that distance is zero.
    """
    return abs(value - optimum) / (abs(optimum - entry.origin) or 1.0)
