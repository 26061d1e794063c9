"""The video of a mission is written and timed, and its parts are measured."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from benchmarks import video_parts, video_time
from benchmarks.video_time import Arguments, VideoFindings, run
from tests.flight import START, above, mountains, save
from tests.renders.drawn import needs_opengl


@needs_opengl
def test_a_video_is_timed_whole_and_by_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video_time, "OPENGL", os.environ.get("MUJOCO_GL", ""))
    monkeypatch.setattr(video_time, "drawn", lambda folder, size, frames: video_parts.measured(folder, *size, frames))
    terrain = mountains()
    mission = {"start": above(terrain, START, 600.0), "target": above(terrain, (START[0] + 300.0, START[1]), 600.0)}
    small = Arguments(save(terrain, tmp_path / "mountains.npz"), width=64, height=36, fps=1, repetitions=1, frames=2)
    with open(os.devnull, "w") as nowhere:
        found = run(small, Console(file=nowhere), mission)
        found.show(Console(file=nowhere))
    assert found.frames > 5
    assert found.wall[0] > 0.0
    assert set(found.parts) == {"scene", "frame", "drawing", "bare", "encoding"}
    assert 0.0 < found.parts["bare"] < found.parts["scene"]


def test_a_process_that_cannot_draw_is_no_measurement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video_time.opengl, "environment", lambda: dict(os.environ))
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(RuntimeError, match="exit code 1"):
        video_time.drawn(tmp_path, (64, 36), 1)


def test_the_whole_has_a_goal_and_the_bare_scene_is_the_limit() -> None:
    parts = {"scene": 1.0, "frame": 0.06, "drawing": 0.05, "bare": 0.04, "encoding": 0.01}
    findings = VideoFindings((1920, 1080), 100, np.array([12.0]), parts)
    whole, frame = findings.comparisons()
    assert (whole.holds, whole.ratio) == (False, pytest.approx(1.2))
    assert frame.ratio == pytest.approx(1.5)
    console = Console(record=True, width=100, file=open(os.devnull, "w"))  # noqa: SIM115
    findings.show(console)
    assert "8.0 s in all" in console.export_text()
    assert json.dumps(findings.plain())
