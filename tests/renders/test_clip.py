"""A clip shows the stretch that was asked for, over and over, in letters that can be read."""

from __future__ import annotations

from collections.abc import Generator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.commands.cli import main
from mathnavi.renders import clip
from mathnavi.renders.clip import LAST_MOMENT, write_clip
from mathnavi.renders.film import Frame
from mathnavi.renders.overlay import Label, Overlay, OverlayWriter
from mathnavi.renders.palette import Picture, SceneElement
from mathnavi.sim.scenarios.textbook import TextbookConfig, TextbookObserver
from tests.renders.drawn import needs_opengl

GREY = np.full((360, 640, 3), 128, np.uint8)
SMALL = {"width": 320, "height": 180, "fps": 4, "length": 1.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that needs no OpenGL to be drawn."""
    path = tmp_path_factory.mktemp("clip")
    TextbookObserver.build(TextbookConfig("camera-and-flags", duration=2.0), 0).run().write(path)
    return path


@pytest.mark.honoured("image", "GIF, WebP that play over and over")
@needs_opengl
def test_a_clip_plays_over_and_over_and_holds_its_last_picture(folder: Path, tmp_path: Path) -> None:
    path = write_clip(folder, begin=0.5, end=2.0, path=tmp_path / "clip.webp", **SMALL)  # type: ignore[arg-type]
    assert [file.name for file in tmp_path.iterdir()] == ["clip.webp"]
    with Image.open(path) as moving:
        assert (moving.format, moving.size, moving.n_frames, moving.info["loop"]) == ("WEBP", (320, 180), 5, 0)
        shown = []
        for k in range(5):
            moving.seek(k)
            shown.append(np.asarray(moving.convert("RGB")).astype(int))
            assert moving.info["duration"] == (250 if k < 4 else 1000 * LAST_MOMENT)
    assert min(picture.std() for picture in shown) > 10.0
    assert all((np.abs(b - a).max(axis=-1) > 40).any() for a, b in pairwise(shown))


def test_a_clip_of_a_run_whose_highlight_is_one_moment_shows_the_whole_run(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    moments: list[float] = []

    def drawn(directory: Path, frames: list[Frame], *size: int) -> Generator[Picture]:
        moments[:] = [frame.t for frame in frames]
        yield from (GREY for _ in frames)

    monkeypatch.setattr(clip, "draw", drawn)
    for given, expected in (({}, (0.0, 2.0)), ({"begin": 0.5}, (0.5, 2.0)), ({"end": 1.5}, (0.0, 1.5))):
        write_clip(folder, path=tmp_path / "clip.webp", **given, **SMALL)  # type: ignore[arg-type]
        assert (moments[0], moments[-1]) == pytest.approx(expected)


@pytest.mark.refused("image", "clips that are too large")
def test_what_would_be_too_large_is_refused(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clip, "MOST_BYTES", 100)
    monkeypatch.setattr(clip, "draw", lambda *_: (picture for picture in (GREY,)))
    with pytest.raises(RuntimeError, match=r"bytes at the lowest quality; allowed: at most 100"):
        write_clip(folder, begin=0.0, end=2.0, path=tmp_path / "clip.webp")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ("--clip --begin 2", "--begin = 2 s; allowed: 0 to less than 2 s, the length of the run"),
        ("--clip --begin -1", "--begin = -1 s; allowed: 0 to less than 2 s, the length of the run"),
        ("--clip --begin 1 --end 1", "--end = 1 s; allowed: more than 1, where it begins, to 2 s"),
        ("--clip --begin 1 --end 3", "--end = 3 s; allowed: more than 1, where it begins, to 2 s"),
        ("--clip --camera chase", "--camera = 'chase'; allowed: board"),
        ("--clip --still", "--clip = True; allowed: not together with --still"),
        ("--begin 1", "--begin = 1.0; allowed: only together with --clip"),
        ("--still --end 1", "--end = 1.0; allowed: only together with --clip"),
        ("--clip --time 1", "--time = 1.0; allowed: only together with --still"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    flags: str, expected: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["render", str(folder), *flags.split()]) == 2
    assert capsys.readouterr().err == f"mathnavi: {expected}\n"
    assert not list(folder.glob("*.webp"))


# ---- what is written on it


def written(
    *labels: Label, annotation: str = "", legend: tuple[SceneElement, ...] = (SceneElement.FLOWN,)
) -> np.ndarray:
    numbers = [(name, "1 s", "") for name in ("TIME", "HEIGHT", "SPEED")]
    overlay = Overlay(["a very long title"] * 3, numbers, "flying", legend)
    return OverlayWriter(640, 360, brief=True).write(GREY, overlay, annotation, 0.5, [0.1], labels).astype(int)


def changed(picture: np.ndarray, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels that differ."""
    return np.nonzero(np.abs(picture - before).max(axis=-1) > 0)


def test_a_brief_caption_leaves_most_of_the_picture_free_and_has_all_of_its_legend() -> None:
    few, all_parts = written(), written(legend=tuple(SceneElement)[:12])
    rows, _ = changed(few, GREY)
    assert ((rows < 70) | (rows > 320)).all()
    assert len(rows) < 0.15 * 640 * 360
    rows, columns = changed(all_parts, few)
    assert rows.min() > 200
    assert columns.max() == 639  # of the strip; what is written ends before it
    white = np.nonzero((all_parts[240:] > 230).all(axis=-1))[1]
    assert white.min() >= 8
    assert white.max() < 632


def test_a_label_gives_way_to_a_notice_and_to_another_label() -> None:
    first, second = Label("target", 300.0, 200.0), Label("radar", 310.0, 205.0)
    assert (written(first) != written()).any()
    np.testing.assert_array_equal(written(first, second), written(first))
    expected = written(annotation="radar on")
    np.testing.assert_array_equal(written(Label("radar", 560.0, 54.0), annotation="radar on"), expected)
