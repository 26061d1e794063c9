"""The sky of a picture is where nothing was drawn: neither black parts nor the edges of bright ones belong to it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.renders.stage import HORIZON, Optics, Stage, View
from tests.renders.drawn import needs_opengl

BOX = """
<mujoco>
  <statistic extent="10"/>
  <visual>
    <global offwidth="64" offheight="48"/> <quality offsamples="{samples}"/>
    <map fogstart="50" fogend="100"/> <rgba fog="{fog} 1"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="flat" rgb1="{fog}" width="8" height="48"/>
    <material name="matt" rgba="{grey} {grey} {grey} 1" specular="0"/>
  </asset>
  <worldbody><geom type="box" size="1 1 1" euler="0 20 0" material="matt"/></worldbody>
</mujoco>
"""


def picture(grey: float, samples: int) -> Array:
    """(48, 64, 3) A tilted box before the sky, in the middle of the picture."""
    fog = " ".join(map(str, HORIZON))
    model = mujoco.MjModel.from_xml_string(BOX.format(grey=grey, samples=samples, fog=fog))
    stage = Stage(model, 64, 48, glow=0.5)
    try:
        stage.look(View.between(np.array([0.0, -8.0, 0.0]), np.zeros(3)), Optics(45.0, 0.01, 10.0), (0,))
        stage.begin(fog=True)
        return stage.end(sky=True).astype(int)
    finally:
        stage.close()


@needs_opengl
@pytest.mark.parametrize("samples", [0, 4])
def test_a_black_part_is_no_sky_and_what_is_empty_is(samples: int) -> None:
    found = picture(0.0, samples)
    assert (found[22:26, 30:34] == 0).all()
    assert found[1, 1, 2] > found[1, 1, 0] > 50  # blue
    assert np.allclose(found[46, 1], 255.0 * np.array(HORIZON), atol=1.0)


@needs_opengl
@pytest.mark.parametrize("samples", [0, 4])
def test_an_edge_before_the_sky_is_not_darker_than_either(samples: int) -> None:
    found = picture(1.0, samples).sum(axis=-1)
    assert found.min() >= min(found[24, 32], found[0].min()) - 3
