"""Excess of innovations over their declared variance, and the covariance of an estimate that it implies; compiled.

A test that alarms says that innovations are not as declared. Sooner than it does, they say by how much they are larger:
with sum e^2 / kappa over the c innovations of a window,

    r = largest over the windows of (sum e^2 / kappa) / chi2_c(0.1), at least 1,    where one is beyond chi2_c(0.001),

is a lower bound of their variance over the declared one, but for one chance in ten. A reading is not known to be worse,
so all of the excess is put to the prediction. Its part P of the innovation's variance P + R, R that of a reading, is
larger by the factor

    (r (P + R) - R) / P = 1 + (r - 1) (P + R) / P.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtri

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers

_LIKELY, _UNLIKELY = 0.1, 1e-3  # levels of what the innovations exceed by chance
_LARGEST = 1e6  # of a factor of variances


def chances(most: int) -> tuple[Array, Array]:
    """Sums of squares (most + 1,) of as many innovations as the index says that chance exceeds once in ten times, and
    once in a thousand.
    """
    freedom = np.arange(1, most + 1)
    likely, unlikely = (np.append(math.inf, chdtri(freedom, level)) for level in (_LIKELY, _UNLIKELY))
    return likely, unlikely


@njit(cache=True, nogil=True)
def factor_of(
    sums: Array,
    k: int,
    columns: tuple[int, int],
    lengths: Integers,
    kappa: float,
    likely: Array,
    unlikely: Array,
    P: float,
    R: float,
) -> float:
    """The factor >= 1 of the variance P of a prediction, where readings have the variance R.

    ``sums`` are those of ``windows`` after k updates, with the running sum of squares and their number in two
    ``columns``; ``likely`` and ``unlikely`` are ``chances``.
    """
    size, excess, beyond_chance = len(sums), 1.0, False
    now, (squares_of, number_of) = sums[k % size], columns
    for length in lengths:
        then = sums[(k - min(length, k)) % size]
        count = int(now[number_of] - then[number_of] + 0.5)
        squares = (now[squares_of] - then[squares_of]) / kappa
        if count > 0:
            excess = max(excess, squares / likely[count])
            beyond_chance = beyond_chance or squares > unlikely[count]
    if not beyond_chance or excess == 1.0:
        return 1.0
    return min(1.0 + (excess - 1.0) * (P + R) / max(P, 1e-12 * (P + R)), _LARGEST)
