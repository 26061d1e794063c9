"""The processes that draw a video begin at once, and make its scene while the report is written."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from mathnavi.commands.run import RunOptions, _draw
from mathnavi.renders import video
from mathnavi.renders.film import Frame
from tests.renders.drawn import draw_apart, needs_opengl

SIZE = (4, 2)


class Artists:
    """Stands in for the process that draws, and notes in ``done`` what it does."""

    done: list[str]

    def __init__(self, *_: Any) -> None:
        self.done.append("begun")

    def __enter__(self) -> Artists:
        return self

    def __exit__(self, *_: object) -> None:
        self.done.append("ended")

    def read(self, artist: int, size: int) -> bytes:
        self.done.append("read")
        return bytes(size)


@needs_opengl
@pytest.mark.parametrize("drawn", [0, 1])
def test_what_draws_begins_before_a_picture_is_asked_for_and_ends_with_the_iterator(
    drawn: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = Artists.done = []
    monkeypatch.setattr(video, "_Artists", Artists)
    monkeypatch.setattr(video.os, "sched_getaffinity", lambda _: {0})
    pictures = draw_apart(Path("run"), [Frame(0.0, "top", 0.0, 0.0)], *SIZE, 0)
    assert done == ["begun"]
    for picture in [next(pictures) for _ in range(drawn)]:
        np.testing.assert_array_equal(picture, np.zeros((*SIZE[::-1], 3)))
    pictures.close()
    assert done == ["begun", *["read"] * drawn, "ended"]


def test_the_report_is_written_between_the_beginning_of_the_video_and_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []

    @contextmanager
    def begun(*_: Any, **__: Any) -> Iterator[Callable[[], None]]:
        done.append("begun")
        yield lambda: done.append("finished")
        done.append("ended")

    monkeypatch.setattr(video, "video_begun", begun)
    monkeypatch.setattr("mathnavi.renders.report.write_report", lambda folder: done.append("report"))
    assert _draw(RunOptions(video=True, report=True), tmp_path, Console(stderr=True))
    assert done == ["begun", "report", "finished", "ended"]
