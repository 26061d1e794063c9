"""Both kinds of vector environment step the same missions, and the ratio is that of their times."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.vector_environments import Arguments, VectorFindings, made, stepped
from tests.sim.environments.missions import hills


def test_both_step_the_same_missions() -> None:
    arguments = Arguments(terrain=hills(), missions=2)
    ours, other = (made(arguments, mode, 0.5) for mode in ("vector_entry_point", "async"))
    seen = [envs.reset(seed=0)[0] for envs in (ours, other)]
    np.testing.assert_allclose(seen[0]["target"], seen[1]["target"])
    assert all(stepped(envs, 1, np.random.default_rng(0)) > 0.0 for envs in (ours, other))
    other.close()


def test_the_ratio_is_asked_for_at_256_missions() -> None:
    seconds = {"1/2 s": (np.array([1e-3, 2e-3]), np.array([0.1, 0.1]))}
    (row,) = VectorFindings(256, seconds).comparisons()
    assert row.ratio == pytest.approx(75.0)
    assert row.holds
    assert VectorFindings(8, seconds).comparisons()[0].holds is None
