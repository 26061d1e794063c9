"""Directed search: a sampler proposes values, missions are flown there, and their figures are reported to it.

    request a batch of values -> trials, flown if the store lacks them -> report the figures to the sampler, in order

The sampler is Optuna's: TPE, the tree-structured Parzen estimator, CMA-ES, or independent draws. Its proposals
follow from its seed and from the reported figures, batch by batch: the same seed and batch give the same search with
any number of workers. So a search that was killed resumes when it is repeated: missions that were flown are found in
the store.

The time of a proposal by TPE grows with the number of evaluations that it has seen. So this number is bounded: at 1,000
it forgets all but the 250 best and, of the others, the 250 newest. The best ones it would split off are among them.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.search.evaluation import Evaluation, Evaluator
from mathnavi.sim.search.space import Choice, Dimension, Range, Values

if TYPE_CHECKING:
    import optuna

Sampler = Literal["tpe", "cmaes", "random"]
_LARGEST = 1e15  # an infinite figure is replaced by this
_MOST, _KEPT = 1000, 250  # evaluations that TPE sees; of these, as many of the best and of the newest stay
_FEWEST = 20  # evaluations from which importances are meaningful


def directed(
    evaluator: Evaluator,
    space: Sequence[Dimension],
    missions: int,
    *,
    sampler: Sampler = "tpe",
    seed: int = 0,
    batch: int = 8,
    until: float | None = None,
    progress: Callable[[Sequence[Evaluation]], None] = lambda _: None,
) -> list[Evaluation]:
    """Evaluate ``missions`` values of the fields of ``space``, fewer if a figure reaches ``until`` before.

    ``batch`` values are proposed at a time. ``progress`` is called with all evaluations so far. A refused mission is
    reported to the sampler as pruned, which it treats as worse than any that was flown, a failed one as failed.
    Raises ValueError for a sampler that cannot search the space, and as ``Evaluator.evaluate`` does.
    """
    proposals = _Proposals(space, sampler, seed)
    found: list[Evaluation] = []
    while len(found) < missions and not any(evaluator.objective.reached(each.figure, until) for each in found):
        asked = [proposals.ask() for _ in range(min(batch, missions - len(found)))]
        evaluations = evaluator.evaluate([values for _, values in asked])
        for (proposal, _), each in zip(asked, evaluations, strict=True):
            cost = None if each.figure is None else evaluator.objective.cost(each.figure)
            proposals.tell(proposal, each, cost)
        found += evaluations
        progress(found)
    return found


def check_space(space: Sequence[Dimension], sampler: Sampler) -> None:
    """Raise ArgumentError for a space that a sampler cannot search."""
    if not space:
        raise ArgumentError("over = nothing; allowed: at least one field to search over")
    ranges = sum(isinstance(dimension, Range) for dimension in space)
    if sampler == "cmaes" and ranges < 2:
        raise ArgumentError(f"sampler = 'cmaes' over {ranges} numeric fields; allowed: two or more, or tpe")


class _Proposals:
    """Optuna's study of a space."""

    def __init__(self, space: Sequence[Dimension], sampler: Sampler, seed: int) -> None:
        import optuna  # takes a while

        check_space(space, sampler)
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        samplers: dict[str, Callable[[], Any]] = {
            "tpe": lambda: optuna.samplers.TPESampler(seed=seed, multivariate=True),
            "cmaes": lambda: optuna.samplers.CmaEsSampler(seed=seed, warn_independent_sampling=False),
            "random": lambda: optuna.samplers.RandomSampler(seed=seed),
        }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            self._study = optuna.create_study(sampler=samplers[sampler]())
        self._forgets, self._seen, self._open = sampler == "tpe", 0, 0
        self._space = space
        self._distributions = {dimension.name: _distribution(dimension) for dimension in space}
        self._pruned, self._failed = optuna.trial.TrialState.PRUNED, optuna.trial.TrialState.FAIL

    def ask(self) -> tuple[optuna.Trial, Values]:
        """Return a proposal and the values that it proposes."""
        if self._forgets and self._seen >= _MOST and not self._open:
            self._forget()
        self._open += 1
        proposal = self._study.ask(self._distributions)
        values = {
            each.name: each.values[proposal.params[each.name]]
            if isinstance(each, Choice)
            else proposal.params[each.name]
            for each in self._space
        }
        return proposal, values

    def tell(self, proposal: optuna.Trial, evaluation: Evaluation, cost: float | None) -> None:
        """Report a proposal's cost, or that it has none."""
        self._seen, self._open = self._seen + 1, self._open - 1
        if cost is not None:
            self._study.tell(proposal, min(max(cost, -_LARGEST), _LARGEST))
        else:
            self._study.tell(proposal, state=self._pruned if evaluation.ending == "refused" else self._failed)

    def _forget(self) -> None:
        """Continue with the best and the newest evaluations, and with the sampler unchanged."""
        import optuna

        trials = self._study.get_trials(deepcopy=False)
        costs = {trial.number: trial.value for trial in trials if trial.value is not None}
        best = set(sorted(costs, key=lambda number: (costs[number], number))[:_KEPT])
        newest = {trial.number for trial in [trial for trial in trials if trial.number not in best][-_KEPT:]}
        kept = [trial for trial in trials if trial.number in best | newest]
        self._study = optuna.create_study(sampler=self._study.sampler)
        self._study.add_trials(kept)
        self._seen = len(kept)


def _distribution(dimension: Dimension) -> optuna.distributions.BaseDistribution:
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    if isinstance(dimension, Choice):
        return CategoricalDistribution(range(len(dimension.values)))
    if dimension.whole:
        return IntDistribution(int(dimension.low), int(dimension.high), log=dimension.log)
    return FloatDistribution(dimension.low, dimension.high, log=dimension.log)


def importances(
    evaluations: Sequence[Evaluation], space: Sequence[Dimension], largest: bool = False
) -> dict[str, float]:
    """Return the importances of the fields for extreme figures, the largest first; {} if too few missions were flown.

    They follow from PED-ANOVA: the distribution of each field among the best tenth against that among all.
    """
    import optuna

    study = optuna.create_study()
    distributions = {dimension.name: _distribution(dimension) for dimension in space}
    for each in evaluations:
        if each.figure is None:
            continue
        values = {
            dimension.name: dimension.values.index(each.values[dimension.name])
            if isinstance(dimension, Choice)
            else each.values[dimension.name]
            for dimension in space
        }
        cost = min(max(-each.figure if largest else each.figure, -_LARGEST), _LARGEST)
        study.add_trial(optuna.trial.create_trial(params=values, distributions=distributions, value=cost))
    if len(study.trials) < _FEWEST or len({trial.value for trial in study.trials}) < 2:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it is new
        return optuna.importance.get_param_importances(study, evaluator=optuna.importance.PedAnovaImportanceEvaluator())
