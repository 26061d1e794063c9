"""Sure and wrong: an estimate that is OK while its error is far beyond what it declares, for longer than a moment.

Of a block of the state, its position for one, with the error e (d,) and the covariance P (d, d) the estimate is wrong
if

    |e| > 3 sqrt(λ_max(P)),

which a Gaussian error exceeds with a probability of 0.3 % for d = 1 and of at most 1.1 % for d = 2, and by chance
seldom for a second on end. Each block is judged by itself: units differ, and so do the things that estimates are used
for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.stretches import stretches

DEVIATIONS = 3.0
LASTING = 1.0
"""[s] for which an estimate is wrong before it counts"""

Flags = NDArray[np.bool_]
POSE = (slice(0, 2), slice(2, 3))
"""blocks of a pose in the plane: position and heading"""


def sure_and_wrong(t: Array, ok: Flags, difference: Array, covariance: Array, blocks: Sequence[slice] = POSE) -> Flags:
    """Return where estimates are sure and wrong, block by block.

    Args:
        t: (n,) [s], increasing.
        ok: (n,) whether the status is OK.
        difference: (n, d) estimate less truth, angles to the nearest; NaN where none exists.
        covariance: (n, d, d); NaN where none is declared, which is not judged.
        blocks: components that are judged together.

    Returns:
        (n, len(blocks)) True within stretches of more than ``LASTING``.
    """
    return np.column_stack([lasting(t, ok & beyond(difference[:, at], covariance[:, at, at])) for at in blocks])


def beyond(difference: Array, covariance: Array) -> Flags:
    """Return (n,) where an error (n, d) is longer than ``DEVIATIONS`` largest deviations of a covariance (n, d, d)."""
    known = np.isfinite(covariance).all(axis=(1, 2)) & np.isfinite(difference).all(axis=1)
    far = np.zeros(len(difference), dtype=bool)
    largest = np.linalg.eigvalsh(covariance[known])[:, -1]
    far[known] = np.linalg.norm(difference[known], axis=1) > DEVIATIONS * np.sqrt(np.maximum(largest, 0.0))
    return far


def lasting(t: Array, flags: Flags, least: float = LASTING) -> Flags:
    """Return (n,) flags (n,) at times t (n,) [s], without stretches of at most ``least`` [s]."""
    ends = np.append(t, t[-1:] + np.diff(t[-2:]))  # a flag holds until the next time
    kept = np.zeros(len(flags), dtype=bool)
    for begin, end in stretches(flags):
        kept[begin:end] = ends[end] - ends[begin] > least * (1.0 + 1e-9)
    return kept
