"""The least separation of a fleet is that of all pairs, whichever of them boxes tell apart."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.fleet import _least_of_segments, least_separation


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(2, 8), st.integers(1, 300))
def test_it_is_that_of_the_first_nearest_of_all_pairs(seed: int, count: int, samples: int) -> None:
    rng = np.random.default_rng(seed)
    truths = {}
    for k in range(count):
        walk = 10.0 ** rng.uniform(0.0, 4.0) * rng.normal(size=3) + np.cumsum(rng.normal(size=(samples, 3)), axis=0)
        truths[f"v{k}"] = np.hstack([walk, np.zeros((samples, 3))])
    if count > 2:
        truths["v2"] = truths["v0"] + 1.0  # so near that others tie with it
    every = {
        pair: float(_least_of_segments(truths[pair[0]][:, :3] - truths[pair[1]][:, :3]))
        for pair in combinations(truths, 2)
    }
    nearest = min(every, key=lambda pair: every[pair])
    recording = Recording(np.arange(float(samples)), truths, {}, [], {})
    assert least_separation(recording, list(truths)) == (every[nearest], nearest)
