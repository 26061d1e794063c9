"""Wrapped angles lie in [-pi, pi) and mean the same."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.models.angles import wrapped
from mathnavi.models.unicycle import kernels


def test_whole_turns_are_taken_away_of_one_angle_and_of_many_as_compiled_code_does() -> None:
    angles = np.concatenate([np.linspace(-20.0, 20.0, 1001), [-math.pi, math.pi, 0.0]])
    found = wrapped(angles)
    assert ((found >= -math.pi) & (found < math.pi)).all()
    np.testing.assert_allclose(np.remainder(angles - found + 1.0, 2.0 * math.pi), 1.0, atol=1e-13)
    np.testing.assert_array_equal(found, [kernels.wrapped(angle) for angle in angles.tolist()])
    np.testing.assert_array_equal(found, [wrapped(angle) for angle in angles.tolist()])
