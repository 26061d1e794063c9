"""Directed search: a sampler proposes values, missions are flown there, and their figures are reported to it.

    request a batch of values -> trials, flown if the store lacks them -> report the figures to the sampler, in order

The proposals follow from the sampler's seed and from the reported figures, batch by batch: the same seed and batch give
the same search with any number of workers. So a search that was killed resumes when it is repeated: missions that were
flown are found in the store.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.search.evaluation import Evaluation, Evaluator
from mathnavi.sim.search.samplers import SamplerName, make_sampler
from mathnavi.sim.search.space import Dimension, drawn


def directed(
    evaluator: Evaluator,
    space: Sequence[Dimension],
    missions: int,
    *,
    sampler: SamplerName = "sobol-cmaes",
    seed: int = 0,
    batch: int = 8,
    until: float | None = None,
    progress: Callable[[Sequence[Evaluation]], None] = lambda _: None,
) -> list[Evaluation]:
    """Evaluate ``missions`` values of the fields of ``space``, fewer if a figure reaches ``until`` before.

    ``batch`` values are proposed at a time. ``progress`` is called with all evaluations so far. A refused mission is
    reported to the sampler as worse than any that was flown; of a failed one the sampler learns nothing.
    Raises ArgumentError for a space without a field, and as ``Evaluator.evaluate`` does.
    """
    check_space(space)
    proposals = make_sampler(sampler, len(space), seed)
    found: list[Evaluation] = []
    while len(found) < missions and not any(evaluator.objective.reached(each.figure, until) for each in found):
        asked = [proposals.ask() for _ in range(min(batch, missions - len(found)))]
        evaluations = evaluator.evaluate([drawn(space, shares) for shares in asked])
        for shares, each in zip(asked, evaluations, strict=True):
            proposals.tell(shares, _cost(evaluator, each))
        found += evaluations
        progress(found)
    return found


def check_space(space: Sequence[Dimension]) -> None:
    """Raise ArgumentError for a space without a field."""
    if not space:
        raise ArgumentError("over = nothing; allowed: at least one field to search over")


def _cost(evaluator: Evaluator, evaluation: Evaluation) -> float | None:
    if evaluation.figure is None:
        return math.inf if evaluation.ending == "refused" else None
    return min(evaluator.objective.cost(evaluation.figure), sys.float_info.max)  # so that every refused one is worse
