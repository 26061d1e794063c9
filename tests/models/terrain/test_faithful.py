"""What a map keeps of its file: no ground of the file is above the map by more than the map says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from rasterio.transform import from_origin

import mathnavi as mn
from mathnavi.controllers.quadrotor.similarity import _magnified
from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.raster import Raster
from mathnavi.models.terrain.resampling import bilinear, rises, square_grid
from tests.models.terrain.test_geotiff import save


@given(
    seed=st.integers(0, 2**32 - 1),
    north=st.floats(15.0, 60.0),
    east=st.floats(15.0, 60.0),
    spacing=st.floats(12.0, 80.0),
)
def test_no_ground_of_a_file_is_above_the_map_by_more_than_its_bound(
    seed: int, north: float, east: float, spacing: float
) -> None:
    rng = np.random.default_rng(seed)
    z = rng.uniform(0.0, 50.0, (12, 14)) + 300.0 * (rng.random((12, 14)) < 0.1)
    raster = Raster("raster", z, north, east)
    grid = square_grid(raster, spacing)
    assume(grid.resampled)
    terrain = HeightField(grid.z, spacing, above=rises(raster, grid))
    x, y = rng.uniform(0.0, terrain.width, 4000), rng.uniform(0.0, terrain.depth, 4000)
    file = bilinear(z, y / north, x / east)
    j, i = (y / spacing).astype(int), (x / spacing).astype(int)
    above_diagonal = (y / spacing - j > x / spacing - i).astype(int)
    assert terrain.above is not None
    assert (file - terrain.height(x, y) <= terrain.above[j, i, above_diagonal] + 1e-6).all()
    assert (file <= terrain.highest.height(x, y) + 1e-6).all()


def test_the_bound_is_what_a_ridge_between_two_nodes_loses() -> None:
    z = np.full((9, 9), 100.0)
    z[:, 4] = 400.0
    raster = Raster("ridge", z, 30.0, 20.0)
    grid = square_grid(raster, 24.0)
    assert grid.z.max() < 400.0 - 50.0
    assert terrain_of(raster, 24.0).highest.z.max() == pytest.approx(400.0, abs=60.0)
    whole = square_grid(Raster("ridge", z, 20.0, 20.0))
    assert rises(Raster("ridge", z, 20.0, 20.0), whole) is None  # the same nodes are the same ground


def terrain_of(raster: Raster, spacing: float) -> HeightField:
    grid = square_grid(raster, spacing)
    return HeightField(grid.z, spacing, above=rises(raster, grid))


HILLS = 400.0 + 10.0 * np.add.outer(np.sin(np.arange(81.0)), np.cos(np.arange(81.0)))


def filled_map(folder: Path, **words: float) -> HeightField:
    values = HILLS.copy()
    values[38:43, 38:43] = -9999.0
    path = save(folder / "a.tif", values.astype(np.float32), nodata=-9999.0, place=from_origin(5e5, 4.7e6, 30.0, 30.0))
    return import_dem(path, folder / "a.npz", fill=True, **words)


def test_no_plan_over_ground_that_was_filled_is_certified(tmp_path: Path) -> None:
    terrain = filled_map(tmp_path)
    plan = mn.FlightPlan.from_inputs(
        [0.0, 10.0, 20.0], [300.0, 1200.0, 2000.0, 0.0, 0.0, 0.0], [[16.0, 0.0, 0.0], [-16.0, 0.0, 0.0]]
    )
    verdict = mn.certify(plan, terrain)
    assert not verdict
    assert verdict.clearance < 0.0  # it is not that above a guess
    assert "filled cells at (1" in verdict.reason
    assert mn.certify(plan, filled_map(tmp_path, void_error=100.0))
    assert not mn.certify(plan, filled_map(tmp_path, void_error=1600.0))  # it says that the ground may be as high
    beside = mn.FlightPlan.from_inputs(
        [0.0, 10.0, 20.0], [300.0, 300.0, 2000.0, 0.0, 0.0, 0.0], [[16.0, 0.0, 0.0], [-16.0, 0.0, 0.0]]
    )
    assert mn.certify(beside, terrain)
    with pytest.raises(ValueError, match=r"start = .* is over ground that was filled"):
        mn.plan_flight(terrain, (1200.0, 1200.0, 2000.0), (300.0, 300.0, 2000.0))


def test_a_magnified_map_is_as_high_as_the_file_can_be(tmp_path: Path) -> None:
    """The planner of point masses, which plans for a quadrotor over a magnified map."""
    coarse = HeightField(HILLS, 30.0, above=np.full((80, 80, 2), 7.0))
    np.testing.assert_array_equal(_magnified(coarse, 2.0).z, 2.0 * (HILLS + 7.0))
    plain = HeightField(HILLS, 30.0)
    np.testing.assert_array_equal(_magnified(plain, 2.0).z, 2.0 * HILLS)
    assert _magnified(filled_map(tmp_path), 90.0).walled(1200.0 * 90.0, 1200.0 * 90.0)


@pytest.mark.honoured("DEM", "compound coordinate system with a vertical datum")
@pytest.mark.honoured("DEM", ".npz: above, datum")
def test_a_map_carries_its_bound_and_its_datum(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", HILLS.astype(np.float32), "EPSG:32644+5773", units="m")
    coarse = import_dem(path, tmp_path / "coarse.npz", resample=45.0)
    assert coarse.datum == "geoid (EGM96 height)"
    assert coarse.above is not None
    again = import_dem(tmp_path / "coarse.npz", tmp_path / "again.npz")
    assert again.above is not None
    assert (again.above >= coarse.above).all()
    assert again.digest != HeightField(coarse.z, 45.0).digest
    assert import_dem(path, tmp_path / "fine.npz").above is None


@pytest.mark.refused("DEM", ".npz: above of another shape, negative or NaN")
@pytest.mark.parametrize(
    ("above", "message"),
    [(np.zeros((3, 3)), r"above has shape \(3, 3\)"), (np.full((1, 1, 2), -1.0), "above has a value"),
     (np.full((1, 1, 2), np.nan), "above has a value")],
)  # fmt: skip
def test_a_bound_that_is_none_is_refused(above: NDArray[np.float64], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        HeightField(np.zeros((2, 2)), 1.0, above=above)
