"""The cross product of two vectors is NumPy's."""

from __future__ import annotations

import numpy as np

from mathnavi.models.cross_product import cross


def test_it_is_that_of_numpy_bit_for_bit() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 200, 3)) * 10.0 ** rng.integers(-9, 9, (2, 200, 3))
    for one, other in zip(a, b, strict=True):
        np.testing.assert_array_equal(cross(one, other), np.cross(one, other))
