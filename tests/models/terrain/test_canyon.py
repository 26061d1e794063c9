"""Canyons made from a number: the same ground every time, a floor that leads through, walls, and their names."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import label

from mathnavi.models.terrain.library import load_terrain, place_of
from mathnavi.models.terrain.synthetic import canyon

NUMBERS = (0, 1, 7, 123_456_789)
made = cache(canyon)


def test_a_number_makes_one_ground_and_another_number_another() -> None:
    assert made(0).digest == canyon(0).digest == canyon().digest
    assert len({made(number).digest for number in NUMBERS}) == len(NUMBERS)


@pytest.mark.parametrize("number", NUMBERS)
def test_it_is_a_plateau_with_a_gorge_that_leads_from_the_west_to_the_east(number: int) -> None:
    ground = made(number)
    assert ground.z.shape == (161, 161)
    assert ground.width == ground.depth == 640.0
    low = ground.z <= ground.z.min() + 15.0
    assert 0.04 < low.mean() < 0.2
    parts, _ = label(low)
    assert set(parts[:, 0]) & set(parts[:, -1]) - {0}  # one floor touches both sides
    assert 90.0 < np.median(ground.z) - ground.z.min() < 130.0
    slope = np.hypot(*np.gradient(ground.z, ground.spacing))
    assert slope.max() < 4.5
    assert (slope > 1.0).mean() > 0.1  # it has walls


@pytest.mark.parametrize("number", NUMBERS)
def test_its_branch_leads_north_off_the_gorge(number: int) -> None:
    ground = made(number)
    parts, _ = label(ground.z <= ground.z.min() + 40.0)
    gorge = parts == next(iter(set(parts[:, 0]) & set(parts[:, -1]) - {0}))
    rows = np.nonzero(gorge)[0] * ground.spacing
    assert rows.max() > 430.0


def test_heights_are_whole_64ths_so_that_digests_last() -> None:
    np.testing.assert_array_equal(64.0 * made(7).z, np.round(64.0 * made(7).z))


def test_a_canyon_is_loaded_by_its_name_and_number() -> None:
    assert load_terrain("canyon").digest == made(0).digest
    assert load_terrain("canyon:12").name == "canyon 12"
    assert load_terrain("canyon:12") is load_terrain("canyon:12")


@pytest.mark.parametrize("name", ["canyon:-1", "canyon:x", "canyon:1.5", "canyon:1234567890", "tian_shan:3"])
def test_a_number_that_makes_no_terrain_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=rf"terrain '{name}': allowed: a whole number"):
        load_terrain(name)


def test_a_negative_number_is_refused() -> None:
    with pytest.raises(ValueError, match=r"canyon number = -1; allowed"):
        canyon(-1)


def test_a_place_is_recorded_so_that_it_is_found_from_any_folder() -> None:
    assert place_of("canyon:3") == "canyon:3"
    assert place_of("tian_shan") == "tian_shan"
    assert place_of("map.npz") == str(Path("map.npz").resolve())
