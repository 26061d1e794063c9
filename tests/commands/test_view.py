"""``mathnavi view``: bodies stand where the log says, and without a display one line says what to do instead."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.commands.view import play, read_replay
from mathnavi.models.aerial.entity import build_model
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.engine.scene_record import RecordedMotion
from tests.flight import mountains


class Viewer:
    """A stand-in for the handle of ``mujoco.viewer``, open for so many frames."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, frames: int) -> None:
        self.user_scn, self.cam, self.data = mujoco.MjvScene(model, 1000), SimpleNamespace(), data
        self.frames = frames
        self.seen: list[Any] = []

    def lock(self) -> nullcontext[None]:
        return nullcontext()

    def is_running(self) -> bool:
        self.frames -= 1
        return self.frames >= 0

    def sync(self) -> None:
        self.seen.append(np.concatenate((self.data.qpos, self.data.qvel)))


def test_bodies_stand_where_the_log_says_and_begin_again(runs: Path) -> None:
    replay = read_replay(runs / "robot")
    viewer = Viewer(replay.plant.model, replay.plant.data, 4)
    times = iter([0.0, 0.0, 0.25, 1.2, 1.6])  # [s] of the clock; the run has .5 s, and a second of rest
    play(replay, viewer, 1.0, lambda: next(times))
    with np.load(runs / "robot" / "log.npz") as log:
        t, x = log["t"], log["truth.x"]
    expected = [x[0], x[np.searchsorted(t, 0.25 + 1e-9) - 1], x[-1], x[np.searchsorted(t, 0.1 + 1e-9) - 1]]
    np.testing.assert_array_equal(viewer.seen, expected)
    assert viewer.user_scn.ngeom > 10  # of the path


def test_a_point_is_shown_as_its_airframe() -> None:
    start, asked = np.array([3000.0, 3000.0, 800.0, 10.0, 0.0, 0.0]), np.array([0.0, 5.0, 0.0])
    plant = MujocoPlant(build_model(mountains(), ["v"], 33.0), {"v": VehicleSetup(start)}, np.random.default_rng(0))
    states = start + np.outer([0.0, 1.0], [10.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    replay = RecordedMotion(plant, np.array([0.0, 1.0]), {"v": states}, {"v": np.array([asked, asked])})
    replay.show(1.0)
    np.testing.assert_array_equal(plant.data.body("v/airframe").xpos, states[1, :3])
    assert plant.data.body("v/airframe").xmat[5] > 0.0  # the thrust leans to where the input points
    np.testing.assert_array_equal(replay.path("v", 10), states[:, :3])


def test_without_a_display_one_line_says_what_to_do(
    runs: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for display, message in ((None, "DISPLAY is not set"), (":4711", ":4711")):
        monkeypatch.delenv("DISPLAY", raising=False)
        if display:
            monkeypatch.setenv("DISPLAY", display)
        assert main(["view", str(runs / "robot")]) == 2
        said = capsys.readouterr().err
        assert message in said
        assert "mathnavi render" in said
        assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("run", "message"), [("numbers", "no body in MuJoCo"), ("absent", "config.json"), ("unlike", "truth.x")]
)
def test_what_cannot_be_shown_is_refused_in_one_line(
    runs: Path, run: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = runs / run
    if run == "unlike":  # the log of another robot's states
        folder = tmp_path
        for file in (runs / "robot").iterdir():
            if file.suffix != ".npz":
                (folder / file.name).write_bytes(file.read_bytes())
        with np.load(runs / "robot" / "log.npz") as log:
            np.savez(folder / "log.npz", **{**log, "truth.x": log["truth.x"][:, :-1]})
    capsys.readouterr()
    assert main(["view", str(folder)]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_a_speed_is_positive(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", str(runs / "robot"), "--speed", "0"]) == 2
    assert "--speed = 0.0; allowed: a finite value > 0" in capsys.readouterr().err
