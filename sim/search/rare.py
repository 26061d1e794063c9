"""Probability of a rare event: multilevel splitting over the random streams of a scenario.

A particle is a chain of redraws (``mathnavi.sim.scenarios.redraw``), the first of everything; the kernel appends one
more, of a share drawn from ``SHARES``. The level is the figure of the mission. A refused mission is infinitely far from
the event, a failed one counts as the event. Fields with a range are uniform over it, or over its logarithm, and are
redrawn like any other block.

**Adaptive multilevel splitting**: the probability of an event that is rare under the prior.

A level S(X) measures how near a draw X comes to the event {S(X) <= s}, s its threshold (smaller is nearer). N particles
are drawn from the prior. As long as the k-th largest level Z_j lies above s,

    K_j = number of particles with S >= Z_j

of them, those that are farthest from the event, die; each is replaced by a copy of a survivor, which then makes
``steps`` transitions that are reversible with respect to the prior, each accepted only if it stays nearer than Z_j. The
estimate

    p^ = prod_j (1 - K_j / N) * #{S(X_i) <= s} / N

is unbiased for any N, k, steps and kernel (Bréhier, Gazeau, Goudenège, Lelièvre, Rousset, Annals of Applied
Probability 26, 2016; Cérou and Guyader, Stochastic Analysis and Applications 25, 2007). Kernels that mix badly cost
variance, not bias. So the estimate of several independent repetitions is their mean, and the interval follows from
their spread (``mean_interval``).
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np
from scipy.stats import t as student_t

from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.scenarios.redraw import Redraw, generator
from mathnavi.sim.search.evaluation import Evaluation, Evaluator
from mathnavi.sim.search.space import Dimension, Values, drawn

Particle = TypeVar("Particle")


class Prior(Protocol[Particle]):
    """Distribution from which particles are drawn, and a kernel that is reversible with respect to it."""

    def draw(self, rng: np.random.Generator) -> Particle:
        """Draw a particle."""
        ...

    def propose(self, particle: Particle, rng: np.random.Generator) -> Particle:
        """Propose another particle by the kernel."""
        ...


@dataclass(frozen=True)
class Splitting(Generic[Particle]):
    """Result of one repetition: estimates of P(S <= level) for levels that come nearer and nearer to the event."""

    levels: tuple[float, ...]  # Z_0 > Z_1 > ...
    probabilities: tuple[float, ...]  # prod_(i <= j) (1 - K_i / N), of S < Z_j
    estimate: float | None  # p^; None if the evaluations ran out before the event was reached
    evaluations: int
    accepted: float  # share of the transitions
    particles: tuple[tuple[Particle, float], ...]  # at the end, each with its level


def split(
    prior: Prior[Particle],
    evaluate: Callable[[Sequence[Particle]], Sequence[float]],
    threshold: float,
    rng: np.random.Generator,
    *,
    particles: int = 40,
    killed: float = 0.25,
    steps: int = 5,
    most: float = math.inf,
) -> Splitting[Particle]:
    """Run one repetition of the algorithm.

    ``evaluate`` returns the levels of particles, ``killed`` is the least share of them that dies at a level. At most
    ``most`` evaluations are begun. Raises ArgumentError for fewer than two particles and a share that kills none or
    all.
    """
    kill = math.ceil(killed * particles)
    if not 1 <= kill < particles:
        raise ArgumentError(f"particles = {particles}, killed = {killed}; allowed: at least one dies, and one is left")
    alive = [prior.draw(rng) for _ in range(particles)]
    s = np.array(evaluate(alive), dtype=float)
    count, tried, kept, p = particles, 0, 0, 1.0
    levels: list[float] = []
    probabilities: list[float] = []

    def result(estimate: float | None) -> Splitting[Particle]:
        ends = tuple(zip(alive, s.tolist(), strict=True))
        return Splitting(tuple(levels), tuple(probabilities), estimate, count, kept / max(tried, 1), ends)

    while True:
        level = float(np.sort(s)[particles - kill])  # at least ``kill`` particles are as far away or farther
        if level <= threshold:
            return result(p * float(np.mean(s <= threshold)))
        dead, left = np.flatnonzero(s >= level), np.flatnonzero(s < level)
        p *= len(left) / particles
        levels.append(level)
        probabilities.append(p)
        if not len(left):  # all are equally far: extinct
            return result(0.0)
        if count + steps * len(dead) > most:
            return result(None)
        for k, parent in zip(dead, rng.choice(left, len(dead)), strict=True):
            alive[k], s[k] = alive[parent], s[parent]
        for _ in range(steps):
            proposed = [prior.propose(alive[k], rng) for k in dead]
            count, tried = count + len(dead), tried + len(dead)
            for k, particle, there in zip(dead, proposed, evaluate(proposed), strict=True):
                if there < level:
                    alive[k], s[k] = particle, there
                    kept += 1


@dataclass(frozen=True)
class ProbabilityInterval:
    """Probability with the limits that cover it with a given confidence."""

    value: float
    low: float
    high: float
    repetitions: int
    confidence: float = 0.95


def mean_interval(estimates: Sequence[float], confidence: float = 0.95) -> ProbabilityInterval:
    """Return the mean of unbiased estimates of a probability, from independent repetitions, and its interval.

    The estimates are skewed, nearly log-normal, so Student's interval is taken for the logarithm of their mean, p
    exp(+- t s / (p sqrt(n))). If every estimate is 0, the interval is 0 to 1. Raises ArgumentError for fewer than two.
    """
    n = len(estimates)
    if n < 2:
        raise ArgumentError(f"estimates = {n}; allowed: two or more, as their spread gives the interval")
    mean = float(np.mean(estimates))
    if mean == 0.0:
        return ProbabilityInterval(0.0, 0.0, 1.0, n, confidence)
    error = float(np.std(estimates, ddof=1)) / (mean * math.sqrt(n))
    width = math.exp(float(student_t.ppf(0.5 + 0.5 * confidence, n - 1)) * error)
    return ProbabilityInterval(mean, mean / width, min(1.0, mean * width), n, confidence)


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
    """Return the probability of the nearest level that every repetition has reached.

    A repetition without levels began at the event, beyond any level of the others.
    """
    common = max(each.levels[-1] for each in made if each.levels)
    before = [
        max((k for k, level in enumerate(each.levels) if level >= common and each.probabilities[k] > 0.0), default=-1)
        for each in made
    ]
    estimates = [1.0 if k < 0 else each.probabilities[k] for k, each in zip(before, made, strict=True)]
    return RareEvent(cost(common), mean_interval(estimates), False, made)


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(LARGEST_SEED))
