"""Probability of a rare event: multilevel splitting over the random streams of a scenario.

A particle is a chain of redraws (``mathnavi.sim.scenarios.redraw``), the first of everything; the kernel appends one
more, of a share drawn from ``SHARES``. The level is the figure of the mission. A refused mission is infinitely far from
the event, a failed one counts as the event. Fields with a range are uniform over it, or over its
logarithm, and are redrawn like any other block.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.scenarios.redraw import Redraw, generator
from mathnavi.sim.search.evaluation import Evaluation, Evaluator
from mathnavi.sim.search.space import Dimension, Values, drawn
from mathnavi.sim.search.splitting import ProbabilityInterval, Splitting, mean_interval, split

REDRAW = "redraw"  # the field of a scenario
SHARES = (0.5, 0.2, 0.05)  # shares of the blocks that a transition draws again: long and short steps

Chain = tuple[Redraw, ...]


@dataclass(frozen=True)
class Chance:
    """Distribution of a scenario's random draws, as chains of redraws."""

    def draw(self, rng: np.random.Generator) -> Chain:
        """Draw everything."""
        return ((_seed(rng), 1.0),)

    def propose(self, particle: Chain, rng: np.random.Generator) -> Chain:
        """Draw a share of the blocks again."""
        return (*particle, (_seed(rng), SHARES[rng.integers(len(SHARES))]))


@dataclass(frozen=True)
class RareEvent:
    """Probability of {figure at ``level`` or beyond}, over all repetitions."""

    level: float  # figure
    probability: ProbabilityInterval
    reached: bool  # False: the requested level lies beyond, so the event is rarer than ``probability.high`` says
    repetitions: tuple[Splitting[Chain], ...] = field(repr=False)


def chance_values(chain: Chain, space: Sequence[Dimension]) -> Values:
    """Return the fields of a mission that follow from a chain of redraws."""
    shares = [
        float(generator(np.random.SeedSequence(0, spawn_key=(zlib.crc32(each.name.encode()),)), chain).random())
        for each in space
    ]
    return {**drawn(space, shares), REDRAW: chain}


def rare_event(
    evaluator: Evaluator,
    space: Sequence[Dimension],
    threshold: float,
    missions: int,
    *,
    seed: int = 0,
    particles: int = 40,
    repetitions: int = 5,
    progress: Callable[[Sequence[Evaluation]], None] = lambda _: None,
) -> RareEvent:
    """Estimate the probability of a figure at ``threshold`` or beyond, with at most ``missions`` missions in all.

    Raises ValueError for fewer than two repetitions or particles, and if ``missions`` leaves a repetition fewer than
    its particles.
    """
    most = missions // repetitions
    if repetitions < 2:
        raise ArgumentError(f"repetitions = {repetitions}; allowed: two or more, as their spread gives the interval")
    if most < particles:
        raise ArgumentError(
            f"missions = {missions}; allowed: >= {particles * repetitions}, the particles of all repetitions"
        )
    objective = evaluator.objective

    def levels(chains: Sequence[Chain]) -> list[float]:
        evaluations = evaluator.evaluate([chance_values(chain, space) for chain in chains])
        progress(evaluator.evaluations)
        return [
            {"refused": math.inf, "failed": -math.inf}[each.ending]
            if each.figure is None
            else objective.cost(each.figure)
            for each in evaluations
        ]

    made = tuple(
        split(
            Chance(),
            levels,
            objective.cost(threshold),
            np.random.default_rng([seed, k]),
            particles=particles,
            most=most,
        )
        for k in range(repetitions)
    )
    estimates = [each.estimate for each in made if each.estimate is not None]
    if len(estimates) == repetitions and any(estimates):
        return RareEvent(threshold, mean_interval(estimates), True, made)
    return _bound(made, objective.cost)


def _bound(made: tuple[Splitting[Chain], ...], cost: Callable[[float], float]) -> RareEvent:
    """Return the probability of the nearest level that every repetition has reached."""
    common = max(each.levels[-1] for each in made)
    before = [
        max((k for k, level in enumerate(each.levels) if level >= common and each.probabilities[k] > 0.0), default=-1)
        for each in made
    ]
    estimates = [1.0 if k < 0 else each.probabilities[k] for k, each in zip(before, made, strict=True)]
    return RareEvent(cost(common), mean_interval(estimates), False, made)


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(LARGEST_SEED))
