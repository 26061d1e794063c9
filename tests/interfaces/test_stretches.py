"""Stretches of samples."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.stretches import stretches


def test_stretches_are_from_the_first_to_behind_the_last() -> None:
    assert stretches(np.array([True, False, True, True, False])).tolist() == [[0, 1], [2, 4]]
    assert stretches(np.ones(3, np.bool_)).tolist() == [[0, 3]]
    assert not len(stretches(np.zeros(3, np.bool_)))
