"""Stretches of samples over which something holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Integers


def stretches(flags: NDArray[np.bool_]) -> Integers:
    """Where flags (n,) are true: the first of each stretch and the one behind its last, (k, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    found: Integers = edges.reshape(-1, 2).astype(np.int64)
    return found
