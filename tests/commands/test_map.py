"""``mathnavi map``: a map of a building becomes walls, and what is no map is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.commands.cli import main
from mathnavi.models.field.map_file import load_map

YAML = """image: map.png
resolution: 0.1
origin: [-4.0, -3.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A map.yaml of a room of 7.4 m by 5.4 m with a table of 1 m by 1.5 m."""
    monkeypatch.chdir(tmp_path)
    cells = np.full((60, 80), 254, np.uint8)
    cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = 0
    cells[20:35, 30:40] = 0
    Image.fromarray(cells).save("map.png")
    Path("map.yaml").write_text(YAML)
    return tmp_path


def test_a_map_becomes_walls_and_is_shown(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", "import", "map.yaml", "--out", "walls"]) == 0
    assert main(["map", "show", "walls"]) == 0
    said = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert "extent -3.70 to 3.70 m by -2.70 to 2.70 m" in said
    assert said.count("free area 38.5 m^2") == 2
    assert "segments 8 in 2 rings, of 1 to 7.4 m" in said
    walls = load_map("walls")
    assert walls.area == pytest.approx(7.4 * 5.4 - 1.5)
    assert walls.contains(np.array([2.0, 1.0]))
    assert not walls.contains(np.array([-0.5, 0.25]))  # on the table
    ranges, _ = walls.ranges(np.array([-0.5, -1.0, 0.0]), np.array([0.0, np.pi / 2.0]))
    assert ranges == pytest.approx([4.2, 0.5], abs=1e-9)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("map", ["map", "import"]),
        ("map draw map.yaml", ["draw", "import"]),
        ("map import map.yaml", ["--out"]),
        ("map import map.yaml --out walls --deviation -1", ["--deviation = -1", ">= 0"]),
        ("map import map.yaml --out walls --channel scan", ["--channel", "with scans"]),
        ("map import missing.yaml --out walls", ["missing.yaml", "No such file"]),
        ("map import map.png --out walls", ["map.png"]),
        ("map show map.png", ["map.png", ".json", ".yaml"]),
        ("map show missing", ["missing"]),
    ],
)
def test_what_is_no_map_is_refused(room: Path, words: str, said: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words.split()) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    assert all(word in error for word in said), error
    assert not Path("walls").exists()


@pytest.mark.parametrize(
    ("line", "instead", "said"),
    [
        ("resolution: 0.1", "resolution: -0.1", ["resolution = -0.1"]),
        ("resolution: 0.1", "", ["resolution"]),
        ("image: map.png", "image: gone.png", ["gone.png"]),
        ("free_thresh: 0.196", "free_thresh: 0.9", ["free_thresh"]),
        ("negate: 0", "negate: 7", ["negate = '7'"]),
    ],
)
def test_a_description_that_says_nothing_sensible_is_refused_by_its_entry(
    room: Path, line: str, instead: str, said: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("map.yaml").write_text(YAML.replace(line, instead))
    assert main(["map", "import", "map.yaml", "--out", "walls"]) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    assert all(word in error for word in said), error
    assert not Path("walls").exists()


def test_what_needs_a_smooth_wall_says_so(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["map", "import", "map.yaml", "--out", "walls"])
    words = "run range-localisation --field.shape map --field.map walls --estimator range_observer --out run"
    assert main(words.split()) == 2
    assert "range_observer needs a smooth wall: Proposition C.2" in capsys.readouterr().err
