"""Pictures of an episode: of MuJoCo's scene and of an ODE; they change as the vehicle moves."""

from __future__ import annotations

import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from mathnavi.models.opengl import NoOpenGLError, environment
from mathnavi.renders import snapshots
from mathnavi.renders.episode import _dress
from mathnavi.renders.snapshots import Snapshots
from mathnavi.renders.stage import View
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.environments.gym import LearningEnv, ScenarioEnv
from mathnavi.sim.scenarios.flight_learning import FlightTerms
from tests.renders.drawn import needs_opengl
from tests.sim.environments import missions

DRAWN = """
import numpy as np
from mathnavi.sim.environments.gym import LearningEnv
for scenario, action in (("sphere-observer", [1.0, -1.0, 0.5]), ("textbook-observer", [0.5])):
    env = LearningEnv(scenario, 1, render_mode="rgb_array", hold=0.1)
    env.reset(seed=1)
    for _ in range(2):
        env.step(np.array(action))
    first = env.render()
    for _ in range(4):
        env.step(np.array(action))
    second = env.render()
    assert first.shape == (480, 640, 3) and first.dtype == np.uint8, first.shape
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 20, "one colour"
    assert (first != second).any(), "nothing moves"
    env.close()
"""


@needs_opengl
def test_a_picture_shows_the_scene_and_follows_it() -> None:
    script = [sys.executable, "-c", DRAWN]
    drawn = subprocess.run(script, capture_output=True, text=True, env=environment(), check=False)
    assert drawn.returncode == 0, drawn.stderr


@needs_opengl
@pytest.mark.parametrize("scenario", ["range-localisation", "safe-flight"])
def test_the_process_that_draws_sees_what_mujoco_would_draw_here(scenario: str) -> None:
    """Beams of range sensors and airframes are drawn from readings and poses that the physics does not compute."""
    env = LearningEnv(scenario, 1, hold=0.1)
    env.reset(seed=1)
    for _ in range(2):
        env.step(np.zeros(env.action_space.shape))
    plant = env.episode.present_plant
    while not isinstance(plant, MujocoPlant):
        plant = plant.plant
    size = float(np.ptp(plant.data.geom_xpos[plant.model.geom_bodyid > 0], axis=0).max())
    view = View(plant.data.xpos[-1], 9.0 * max(size, 0.3), 35.0, -18.0)
    here = mujoco.Renderer(plant.model, 120, 160)
    camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = view.lookat, view.distance, 35.0, -18.0
    option.geomgroup[:] = [1, 1, 1, 0, 0, 0]
    here.update_scene(plant.data, camera, option)
    begun = Snapshots(160, 120)
    try:
        np.testing.assert_array_equal(begun.draw(plant.model, plant.data, view), here.render())
    finally:
        begun.close()
        here.close()


@needs_opengl
def test_a_flight_is_drawn_before_and_behind_the_ground_of_videos_under_their_sky() -> None:
    """The same camera sees a vehicle above the ground, and none when it is below."""
    place = np.array([6000.0, 6000.0, 1200.0])
    env = LearningEnv(
        "safe-flight", 1, hold=0.1, terrain=missions.hills(), start=tuple(place), drawn_separation=(0.2, 0.6)
    )
    env.reset(seed=1)
    plant, terms, view = env.episode.present_plant, env.episode.terms, View(place, 36.0, 35.0, -10.0)
    assert isinstance(plant, MujocoPlant)
    assert isinstance(terms, FlightTerms)
    _dress(env.episode, plant)
    begun = Snapshots(160, 120)
    try:
        plain = begun.draw(plant.model, plant.data, view).astype(int)
        above = begun.draw(plant.model, plant.data, view, terms.ground).astype(int)
        plant.data.qpos[2] -= 2000.0
        plant.data.mocap_pos[:, 2] -= 2000.0
        below = begun.draw(plant.model, plant.data, view, terms.ground).astype(int)
    finally:
        begun.close()
    assert plain[2].max() < 60  # the physics has no sky
    assert above[2, :, 2].min() > 150
    assert (above[2, :, 2] > above[2, :, 0]).all()
    assert np.abs(above[-20:, :, 0] - above[-20:, :, 2]).mean() > 10.0  # the ground is not grey
    rows, columns = np.nonzero(np.abs(above - below).sum(axis=2) > 30)
    assert 50 < len(rows) < 8000
    assert np.ptp(rows) < 60
    assert abs(columns.mean() - 80.0) < 20.0


@needs_opengl
def test_a_picture_may_be_larger_than_the_model_says() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco><visual><global offwidth='64' offheight='48'/></visual></mujoco>")
    begun = Snapshots(131, 97)
    try:
        picture = begun.draw(model, mujoco.MjData(model), View(np.zeros(3), 1.0, 0.0, 0.0))
    finally:
        begun.close()
    assert picture.shape == (97, 131, 3)
    assert model.vis.global_.offwidth == 64  # the caller's own is as it was


def test_a_process_that_cannot_draw_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "quantum")
    with pytest.raises(NoOpenGLError, match=r"MUJOCO_GL = quantum; allowed: osmesa, egl, glfw"):
        Snapshots(16, 16)
    monkeypatch.setattr(snapshots, "environment", lambda: {**os.environ, "MUJOCO_GL": "quantum"})
    begun = Snapshots(16, 16)
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(NoOpenGLError, match=r"MUJOCO_GL: quantum; allowed: MUJOCO_GL=osmesa or egl"):
        begun.draw(model, mujoco.MjData(model), View(np.zeros(3), 1.0, 0.0, 0.0))
    begun.close()


def test_a_mode_that_is_none_is_refused_and_without_one_nothing_is_drawn() -> None:
    with pytest.raises(ValueError, match="render_mode = 'ansi'; allowed: rgb_array, human, or None"):
        ScenarioEnv("textbook-observer", render_mode="ansi")
    env = ScenarioEnv("textbook-observer")
    env.reset(seed=1)
    assert env.render() is None
