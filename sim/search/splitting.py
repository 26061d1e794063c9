"""Adaptive multilevel splitting: the probability of an event that is rare under the prior.

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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from scipy.stats import t as student_t

from mathnavi.interfaces.errors import ArgumentError

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
