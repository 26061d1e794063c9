"""Costs at two sizes, and a window of a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.growth import SPACING, Growth, growths, windows, write_geotiff
from mathnavi.models.terrain.raster_file import read_raster
from mathnavi.studies.introduction.cost_measurement import CURVES


def test_sizes_are_those_of_the_study_and_a_cost_is_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    for growth in (*growths(quick=True), *growths(quick=False)):
        assert {growth.small, growth.large} <= set(CURVES[growth.curve].sizes)
        assert growth.small < growth.large
    monkeypatch.setitem(CURVES, "fleet", type("Proportional", (), {"made": abs, "cost": float}))
    monkeypatch.setattr(CURVES["fleet"], "made", lambda size, seed: 3.0 * size)
    assert Growth("", "fleet", 4, 8, 1, "ms", 1e3).cost(8, 0) == 3000.0
    assert Growth("", "fleet", 4, 8, 0, "ms", 1.0).cost(8, 0) == 24.0


def test_a_window_holds_the_heights_of_its_part_and_is_flown_over(tmp_path: Path) -> None:
    for side in (9, 33):
        write_geotiff(tmp_path / f"{side}.tif", side)
    reach = 8 * SPACING
    part = read_raster(tmp_path / "33.tif", (0.0, 0.0, reach, reach))
    assert part.z.shape == (9, 9)
    assert read_raster(tmp_path / "9.tif").z.shape == (9, 9)
    read, flown = windows(repetitions=2, side=97, window=65)
    for row in (read, flown):
        assert (row.software, len(row.ours)) == ("of 65²", 2)
        assert row.ratio > 0.0
