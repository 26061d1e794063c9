"""The terrains that are found by name."""

from __future__ import annotations

import hashlib
import os
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from matplotlib import cbook

from mathnavi.models.terrain import library
from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import GROUP, load_terrain, terrain_names


def test_tian_shan_has_the_size_and_heights_it_is_said_to_have_and_is_north_up() -> None:
    terrain = load_terrain("tian_shan")
    assert terrain.z.shape == (257, 257)
    assert terrain.width == terrain.depth == 81_920.0
    assert (terrain.z.min(), terrain.z.max()) == (1805.0, 6971.0)
    assert "doi:10.5285/f98b053b-0cbc-6c23-e053-6c86abc0af7b" in terrain.source
    assert terrain.licence == "public domain"
    # Jengish Chokusu stands at 42.035 N 80.130 E: 0.56 km north and .8 km east of the centre.
    row, column = np.unravel_index(terrain.z.argmax(), terrain.z.shape)
    assert np.hypot(column * 320.0 - 41_790.0, row * 320.0 - 41_520.0) < 1500.0
    # The wide valley of the Aksu is in the south-east, the inner Tian Shan in the north-west.
    assert terrain.z[:32, -32:].mean() < terrain.z[-32:, :32].mean()


def test_jacksboro_is_a_square_grid_of_low_ridges() -> None:
    terrain = load_terrain("jacksboro")
    assert terrain.spacing == 90.0
    assert 29_000.0 < terrain.width < 30_500.0
    assert 31_000.0 < terrain.depth < 32_500.0
    assert 236.0 <= terrain.z.min() < 300.0
    assert 950.0 < terrain.z.max() <= 1076.0


def test_each_map_states_a_source_and_a_licence_that_sources_md_explains() -> None:
    text = (library.DATA / "SOURCES.md").read_text(encoding="utf-8")
    sections = {section.partition("\n")[0].strip(): section for section in text.split("\n## ")[1:]}
    for name, words in (("tian_shan", "GEBCO"), ("jacksboro", "Shuttle Radar Topography Mission")):
        terrain = load_terrain(name)
        assert words in terrain.source
        assert words in sections[name]
        assert terrain.licence in sections[name]
        for part in ("**Source**", "**Licence**", "**File**"):
            assert part in sections[name]


def test_the_file_of_jacksboro_is_the_one_whose_source_is_recorded() -> None:
    sample = Path(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))
    assert hashlib.sha256(sample.read_bytes()).hexdigest() in (library.DATA / "SOURCES.md").read_text(encoding="utf-8")
    with np.load(sample) as dem:
        edges = np.array([dem["xmin"], dem["xmax"], dem["ymin"], dem["ymax"]], dtype=float)
    centres = edges * 1200.0 - 0.5  # in units of 3 arc-seconds, from an edge to the next node
    np.testing.assert_allclose(centres, np.rint(centres), atol=1e-6)


def test_a_terrain_is_loaded_once() -> None:
    assert load_terrain("tian_shan") is load_terrain("tian_shan")


def test_the_built_in_terrains_are_named() -> None:
    assert {"jacksboro", "tian_shan"} <= set(terrain_names())


def test_an_unknown_name_lists_those_that_exist() -> None:
    with pytest.raises(
        ValueError,
        match=r"terrain = 'everest': not known; allowed: .*jacksboro.*tian_shan.*npz, which mathnavi terrain import",
    ):
        load_terrain("everest")


def test_an_npz_is_loaded_by_its_path_and_again_when_it_changed(tmp_path: Path) -> None:
    path = tmp_path / "hills.npz"
    write_npz(HeightField(np.zeros((3, 3)), 10.0, "hills"), path)
    first = load_terrain(path)
    assert first is load_terrain(str(path))
    write_npz(HeightField(np.ones((3, 3)), 10.0, "hills"), path)
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1_000_000))
    assert load_terrain(path).z.max() == 1.0


def test_an_npz_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.npz"):
        load_terrain(tmp_path / "none.npz")


def not_a_terrain() -> int:
    return 3


def test_an_entry_point_must_return_a_height_field(monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("three", f"{__name__}:not_a_terrain", GROUP)
    monkeypatch.setattr(library, "_installed", lambda: [point])
    assert terrain_names() == ("three",)
    with pytest.raises(ValueError, match=r"terrain 'three': .* returned int, not a HeightField"):
        load_terrain("three")
