"""Stretches of samples over which something holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Integers


def stretches(flags: NDArray[np.bool_]) -> Integers:
    """Return the stretches over which flags (n,) are true, (k, 2): the first of each, and the one behind its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    found: Integers = edges.reshape(-1, 2).astype(np.int64)
    return found
