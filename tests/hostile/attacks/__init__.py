"""Attacks: each makes one hostile input in a working folder, from good files, with a generator of its own.

The number of an input and the seed decide which attack it is, and all that it does: the same numbers of a seed are the
same inputs, whichever others are run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from numpy.random import Generator, default_rng

from tests.hostile.attacks import fields, plugins, results, runs, terrains, words
from tests.hostile.attacks.attack import Attack

ATTACKS: dict[Attack, int] = {
    **words.ATTACKS,
    **fields.ATTACKS,
    **runs.ATTACKS,
    **results.ATTACKS,
    **terrains.ATTACKS,
    **plugins.ATTACKS,
}


def attacks(seed: int, numbers: Sequence[int]) -> Iterator[tuple[int, Generator, Attack]]:
    """The attacks with these numbers, each with its generator."""
    every, weights = list(ATTACKS), list(ATTACKS.values())
    shares = [weight / sum(weights) for weight in weights]
    for k in numbers:
        rng = default_rng([seed, k])
        yield k, rng, every[int(rng.choice(len(every), p=shares))]
