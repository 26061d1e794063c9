"""Hills set on a terrain."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.models.terrain.hill import Hill, with_hills
from tests import flight


def test_a_hill_raises_its_surroundings_and_nothing_else() -> None:
    ground, hill = flight.mountains(), Hill(4000.0, 6000.0, 1000.0, 300.0)
    raised = with_hills(ground, (hill,))
    assert raised.height(4000.0, 6000.0) == pytest.approx(float(ground.height(4000.0, 6000.0)) + 300.0)
    x, y = np.meshgrid(np.arange(61) * 200.0, np.arange(61) * 200.0)
    distance = np.hypot(x - hill.x, y - hill.y)
    np.testing.assert_array_equal(raised.z[distance >= 1000.0], ground.z[distance >= 1000.0])
    assert (raised.z[distance < 999.0] > ground.z[distance < 999.0]).all()
    assert raised.digest != ground.digest
    assert with_hills(ground, ()) is ground


@pytest.mark.parametrize(
    "numbers", [(math.nan, 0.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, -1.0), (0.0, 0.0, 1.0, math.inf)]
)
def test_numbers_that_cannot_be_are_refused(numbers: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match=r"hill: \w+ = .*; allowed"):
        Hill(*numbers)


def test_a_hill_off_the_map_is_refused() -> None:
    with pytest.raises(ValueError, match=r"\(-1.0, 0.0\) m is not on the terrain"):
        with_hills(flight.mountains(), (Hill(-1.0, 0.0, 100.0, 100.0),))
