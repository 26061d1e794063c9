"""Published optimum of an optimal control problem: what a collection prints, and how the problem is stated here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem

Statement = Callable[[], OptimalControlProblem | MultiPhaseProblem]


@dataclass(frozen=True)
class PublishedOptimum:
    """An optimal control problem of a published collection, and the optimum that the collection prints."""

    value: str  # of the quantity, with the digits as printed; "" if the source prints none
    source: str  # collection, file, and where the value is printed
    statement: Statement | None = None  # None: it cannot be stated, and why stands in ``note``
    independent: float | None = None  # of the quantity, by an independent transcription or in closed form, >= 8 digits
    evidence: str = ""  # for ``independent``: "closed form: 4 / (9 L)", "Gauss-Legendre, 120 x 5, and Radau, 120 x 5"
    quantity: str = "J"
    sign: float = 1.0  # J over the quantity: -1 where that is to be greatest
    origin: float = 0.0  # of the quantity, where what matters is the distance from it
    singular: bool = False  # whether the optimum has a singular arc
    same_as: str = ""  # name of the same problem in another source's list, or "collection: NAME" for one of PROBLEMS
    note: str = ""
