"""The random generators of a run, one for each source of chance, all spawned from its seed."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence

import numpy as np

from mathnavi.sim.scenarios.redraw import BlockGenerator, generator

_UNLISTED = 2**32 - 1  # in the spawn key of a stream that is not listed, where no child that is counted ever comes


class RandomStreams:
    """Random generators by name.

    The listed ones are the children of ``root``, in the order of their names. Any other name has a generator too,
    which follows from the seed and the name alone: a new source of chance leaves what all others draw as it was.
    """

    def __init__(
        self,
        root: np.random.Generator,
        names: Sequence[str] = (),
        given: Mapping[str, np.random.Generator] | None = None,
    ) -> None:
        self.root = root
        """the generator that all others are spawned from"""
        self._named = {**(given or {}), **dict(zip(names, root.spawn(len(names)), strict=True))}

    def __getitem__(self, name: str) -> np.random.Generator:
        if name not in self._named:
            parent = self.root.bit_generator.seed_seq
            assert isinstance(parent, np.random.SeedSequence)
            key = (*parent.spawn_key, _UNLISTED, zlib.crc32(name.encode()))
            redraws = self.root.redraws if isinstance(self.root, BlockGenerator) else ()
            self._named[name] = generator(np.random.SeedSequence(parent.entropy, spawn_key=key), redraws)
        return self._named[name]

    def split(self, name: str, count: int) -> list[RandomStreams]:
        """Streams for each of so many vehicles, whose ``name`` is a child of the stream ``name`` of all."""
        return [RandomStreams(child, given={name: child}) for child in self[name].spawn(count)]
