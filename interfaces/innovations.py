"""Innovations that an estimator publishes: what its readings are off from its predictions, and may be off.

Of the m numbers that an estimator reads, always in the same order, ``Estimate.extra`` has two arrays (m,): of the last
reading of each number since the call before, the innovation and its standard deviation by the estimator's model,

    nu_i = y_i - y^_i,    sqrt(S_ii),    S = H P H' + R,

with y^ and P predicted to the time of the reading, before it or any other number of the same instant was used. A number
that was not read, or not tested, is NaN in both; one that was tested and refused has its innovation. Of readings of a
manifold nu has the components of log(y^, y). S has the noise as the estimator knows it, which may have learnt it.

Their ratio e_i = nu_i / sqrt(S_ii) has mean zero and variance one while all is as the mission declares. Numbers of one
instant are correlated by the error of the state; a bound that is no standard deviation does not belong here.

An estimator that does not publish them has neither array.
"""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array

INNOVATIONS, INNOVATION_STD = "innovations", "innovation_std"
"""names of the two arrays in ``Estimate.extra``, each (m,) and in the units of the numbers"""


def published(innovations: Array) -> dict[str, Array]:
    """Both arrays, copies of ``innovations`` (2, m): nu and sqrt(S_ii), NaN of numbers that were not read."""
    return {INNOVATIONS: innovations[0].copy(), INNOVATION_STD: innovations[1].copy()}


def write_innovations(into: Array, nu: Array, variance: Array) -> None:
    """Write nu (m,), NaN of a number that was not read, and the roots of its ``variance`` (m,) ``into`` (2, m)."""
    into[0] = nu
    np.sqrt(variance + 0.0 * nu, out=into[1])  # NaN where nu is
