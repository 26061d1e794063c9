"""Random streams in blocks, of which a share is drawn again: missions that share a part of their random draws.

A redraw is a seed and a share. Every stream of a run, and every stream that is spawned from one, is divided into blocks
of ``BLOCK`` calls. A redraw replaces each block, independently of all others, with the probability of its share by one
that follows from the redraw's seed, the place of the stream and the number of the block; several redraws act one
after the other. Since the choice of replaced blocks does not depend on their content,

    P(block' | block) = (1 - share) delta(block' - block) + share P(block'),

one redraw with a seed drawn at random is a transition that is reversible with respect to the distribution of
independent runs: the kernel of multilevel splitting (``mathnavi.sim.search.rare``). Without a redraw the streams
are numpy's own, not divided.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from mathnavi.interfaces.bounds import LARGEST_SEED, Condition, Each, configuration

BLOCK = 16  # calls; of a gust that is drawn at every control step, a quarter of a second
_REPLACED, _CHOSEN = 2**32 - 2, 2**32 - 3  # in spawn keys, where no child that is counted ever comes

Redraw = tuple[int, float]  # seed, share

_REDRAW = Condition(
    lambda redraw: 0 <= redraw[0] <= LARGEST_SEED and 0.0 < redraw[1] <= 1.0,
    f"a seed from 0 to {LARGEST_SEED} and a share > 0 and <= 1",
)


@configuration
class ChanceFields:
    """Field of a scenario whose random draws can be repeated in part."""

    redraw: Annotated[tuple[Redraw, ...], Each(_REDRAW)] = ()
    """redraw SEED SHARE: a share of the run's random draws, in blocks, is drawn again; may be given several times"""


class BlockGenerator(np.random.Generator):
    """Generator that begins another block of its stream after every ``BLOCK`` calls."""

    def __init__(self, sequence: np.random.SeedSequence, redraws: Sequence[Redraw]) -> None:
        super().__init__(np.random.PCG64(sequence))
        self.redraws = tuple(redraws)
        self._sequence = sequence
        self._calls = 0

    def spawn(self, n_children: int) -> list[np.random.Generator]:
        """Generators of independent streams, with the same redraws."""
        return [BlockGenerator(child, self.redraws) for child in self._sequence.spawn(n_children)]

    def __reduce__(self) -> Any:
        raise TypeError("a stream in blocks cannot be copied; allowed: the seed and the redraws that it follows from")

    def _count(self) -> None:
        """Count a call; the first of a block sets the state to the block's own."""
        block, call = divmod(self._calls, BLOCK)
        self._calls += 1
        if call == 0:
            self.bit_generator.state = np.random.PCG64(self._of_block(block)).state

    def _of_block(self, block: int) -> np.random.SeedSequence:
        key = self._sequence.spawn_key
        for seed, share in reversed(self.redraws):
            chosen = np.random.SeedSequence(seed, spawn_key=(*key, _CHOSEN, block)).generate_state(1, np.uint64)[0]
            if float(chosen) < share * 2.0**64:
                return np.random.SeedSequence(seed, spawn_key=(*key, _REPLACED, block))
        return np.random.SeedSequence(self._sequence.entropy, spawn_key=(*key, _REPLACED, block))


def _counted(name: str) -> Any:
    method = getattr(np.random.Generator, name)

    @functools.wraps(method)
    def draw(self: BlockGenerator, *arguments: Any, **named: Any) -> Any:
        self._count()
        return method(self, *arguments, **named)

    return draw


for _name in dir(np.random.Generator):
    if not _name.startswith("_") and _name not in ("spawn", "bit_generator"):
        setattr(BlockGenerator, _name, _counted(_name))


def generator(sequence: np.random.SeedSequence, redraws: Sequence[Redraw]) -> np.random.Generator:
    """Generator of a seed sequence: numpy's own without redraws, one in blocks with them."""
    return BlockGenerator(sequence, redraws) if redraws else np.random.default_rng(sequence)
