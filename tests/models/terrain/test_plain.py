"""Level ground."""

from __future__ import annotations

import pytest

from mathnavi.models.terrain.library import load_terrain


@pytest.mark.parametrize(("name", "height"), [("plain", 100.0), ("plain:7", 7.0)])
def test_a_plain_is_as_high_everywhere_as_its_number_says(name: str, height: float) -> None:
    terrain = load_terrain(name)
    assert (terrain.z == height).all()
    assert (terrain.width, terrain.depth) == (960.0, 960.0)
