"""Pictures of an episode: of MuJoCo's scene and of an ODE; they change as the vehicle moves."""

from __future__ import annotations

import subprocess
import sys

import pytest

from mathnavi.renders.opengl import available, environment
from mathnavi.sim.environments.gym import ScenarioEnv

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


@pytest.mark.skipif(available() is None, reason="no OpenGL that draws without a screen")
def test_a_picture_shows_the_scene_and_follows_it() -> None:
    script = [sys.executable, "-c", DRAWN]
    drawn = subprocess.run(script, capture_output=True, text=True, env=environment(), check=False)
    assert drawn.returncode == 0, drawn.stderr


def test_a_mode_that_is_none_is_refused_and_without_one_nothing_is_drawn() -> None:
    with pytest.raises(ValueError, match="render_mode = 'ansi'; allowed: rgb_array, human, or None"):
        ScenarioEnv("textbook-observer", render_mode="ansi")
    env = ScenarioEnv("textbook-observer")
    env.reset(seed=1)
    assert env.render() is None
