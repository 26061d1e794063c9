"""Random streams in blocks, of which a share is drawn again."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from mathnavi.interfaces.errors import FieldError
from mathnavi.sim.scenarios.assembler import RandomStreams
from mathnavi.sim.scenarios.redraw import BLOCK, ChanceFields, Redraw, generator
from mathnavi.sim.sweep.trial import trial

ALL: Redraw = (7, 1.0)


def numbers(redraws: tuple[Redraw, ...], seed: int = 3, blocks: int = 100) -> np.ndarray:
    """(blocks, BLOCK) numbers of a stream."""
    rng = generator(np.random.SeedSequence(seed), redraws)
    return np.array([rng.random() for _ in range(blocks * BLOCK)]).reshape(blocks, BLOCK)


def test_without_a_redraw_a_stream_is_numpys_own() -> None:
    assert (numbers(()).ravel() == np.random.default_rng(3).random(100 * BLOCK)).all()


def test_a_redraw_replaces_whole_blocks_and_about_its_share_of_them() -> None:
    before, after = numbers((ALL,)), numbers((ALL, (8, 0.3)))
    same = before == after
    assert (same.all(axis=1) | ~same.any(axis=1)).all()
    assert 15 <= np.count_nonzero(~same.any(axis=1)) <= 45


def test_which_blocks_are_replaced_does_not_depend_on_what_is_in_them() -> None:
    replaced = [(numbers((first,)) != numbers((first, (8, 0.3)))).all(axis=1) for first in (ALL, (9, 1.0))]
    assert (replaced[0] == replaced[1]).all()


def test_a_redraw_of_everything_leaves_nothing_of_the_seed() -> None:
    assert (numbers((ALL,), seed=1) == numbers((ALL,), seed=2)).all()
    assert not (numbers(((8, 0.5),), seed=1) == numbers(((8, 0.5),), seed=2)).all()


def test_replaced_blocks_are_uniform_and_independent_of_those_they_replace() -> None:
    values = np.concatenate([numbers((ALL, (seed, 1.0))).ravel() for seed in range(5)])
    assert abs(values.mean() - 0.5) < 4.0 / np.sqrt(12.0 * len(values))
    before, after = numbers((ALL,)).ravel(), numbers((ALL, (1, 1.0))).ravel()
    assert abs(np.corrcoef(before, after)[0, 1]) < 4.0 / np.sqrt(len(before))


@pytest.mark.parametrize("name", ["listed", "of no list"])
def test_every_stream_of_a_run_is_redrawn_block_by_block(name: str) -> None:
    def first(redraws: tuple[Redraw, ...], number: int) -> float:
        streams = RandomStreams(generator(np.random.SeedSequence(0), redraws), ["another", "listed"])
        return float(streams[name].spawn(40)[number].normal())

    same = [first((ALL,), k) == first((ALL, (8, 0.5)), k) for k in range(40)]
    assert 8 <= sum(same) <= 32


def test_a_stream_in_blocks_is_not_copied_without_its_blocks() -> None:
    with pytest.raises(TypeError, match="cannot be copied"):
        copy.deepcopy(generator(np.random.SeedSequence(0), (ALL,)))


@pytest.mark.parametrize("redraw", [(1, 0.0), (1, 1.1), (-1, 0.5), (2**63, 0.5)])
def test_a_redraw_has_a_seed_and_a_share(redraw: Redraw) -> None:
    with pytest.raises(FieldError, match=r"redraw = .*; allowed: a seed from 0 to"):
        ChanceFields(redraw=(redraw,))


def test_a_flight_that_is_redrawn_in_part_differs_in_part_and_repeats_itself() -> None:
    def flown(*redraws: Redraw) -> tuple[np.ndarray, np.ndarray]:
        fields = {"faults.gust_rms": 1.0, "noise.position": 1.0, "redraw": redraws, "planner.grid_nodes": 17}
        run = trial("safe-flight", 3, terrain="canyon:3", drawn_separation=(0.25, 0.4), fields=fields).flown()
        return run["truth.x"], np.array(run.config["mission"]["start"])

    (x, start), (again, _), (other, _) = flown(ALL), flown(ALL), flown(ALL, (20, 0.3))
    assert np.array_equal(x, again)
    assert not np.array_equal(x[:60], other[:60])
    assert (start == x[0, :3]).all()
