"""Pictures of a MuJoCo model in any of its states, drawn by a child process (for the reason, see
``mathnavi.models.opengl``).

parent -> child     the pickled pair ("model", MjModel), ("ground", HeightField or None), or
                    ("state", (state, readings, camera))
child -> parent     for each state a picture, height x width x 3 bytes
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from contextlib import suppress
from typing import Any

import mujoco
import numpy as np

from mathnavi.models.opengl import NoOpenGLError, environment
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.child import child_command, last_line
from mathnavi.renders.landscape import Landscape
from mathnavi.renders.palette import Picture
from mathnavi.renders.stage import View

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
SHOWN_GROUPS = 3  # of geoms: those of higher groups only touch


class Snapshots:
    """Renderer of a model's states; close it when nothing more is drawn."""

    def __init__(self, width: int, height: int) -> None:
        """``width`` and ``height`` in pixels. NoOpenGLError where there is nothing to draw with."""
        self._shape = (height, width, 3)
        self._model: mujoco.MjModel | None = None
        self._ground: HeightField | None = None
        self._sent = b""
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - until close()
        self._process = subprocess.Popen(
            [*child_command(__name__), str(width), str(height)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, env=environment(), process_group=0,
        )  # fmt: skip

    def draw(
        self, model: mujoco.MjModel, data: mujoco.MjData, camera: View, ground: HeightField | None = None
    ) -> Picture:
        """The picture (height, width, 3) of a state; NoOpenGLError if the process that draws has ended.

        ``ground`` is drawn as in videos, in the place of the model's height field; None for the model unchanged.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        state = np.empty(mujoco.mj_stateSize(model, STATE))
        mujoco.mj_getState(model, data, state, STATE)
        with suppress(BrokenPipeError):  # it has ended, and reading says why
            if ground is not self._ground:
                self._ground, self._model, self._sent = ground, None, b""
                pickle.dump(("ground", ground), self._process.stdin)
            if model is not self._model:
                self._model, content = model, pickle.dumps(("model", model))
                if content != self._sent:  # every episode has its own model, most often the same
                    self._sent = content
                    self._process.stdin.write(content)
            readings = np.array(
                data.sensordata
            )  # rangefinders draw theirs, and a model may have its sensors switched off
            pickle.dump(("state", (state, readings, camera)), self._process.stdin)
            self._process.stdin.flush()
        size = int(np.prod(self._shape))
        pixels = self._process.stdout.read(size)
        if len(pixels) < size:
            raise NoOpenGLError(
                f"the process that draws ended: {last_line(self._errors)}; allowed: MUJOCO_GL=osmesa or egl"
            )
        return np.frombuffer(pixels, np.uint8).reshape(self._shape).copy()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()
        self._errors.close()


def main() -> None:
    """Draw the requests on standard input, until it is closed."""
    width, height = map(int, sys.argv[-2:])
    pictures = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # libraries print what they like
    option = mujoco.MjvOption()
    option.geomgroup[:] = np.arange(len(option.geomgroup)) < SHOWN_GROUPS
    renderer: mujoco.Renderer | None = None
    landscape: Landscape | None = None
    while (request := _received()) is not None:
        what, content = request
        if what == "ground":
            if landscape is not None:
                landscape.close()
            landscape = None if content is None else Landscape(content, width, height)
        elif what == "model":
            if renderer is not None:
                renderer.close()
            buffer = content.vis.global_  # in which MuJoCo draws: no picture may be larger
            buffer.offwidth, buffer.offheight = max(buffer.offwidth, width), max(buffer.offheight, height)
            if landscape is not None:
                landscape.prepare(content)
            data, renderer = mujoco.MjData(content), mujoco.Renderer(content, height, width)
        else:
            assert renderer is not None
            state, readings, view = content
            mujoco.mj_setState(renderer.model, data, state, STATE)
            mujoco.mj_forward(renderer.model, data)
            data.sensordata[:] = readings
            if landscape is not None:
                landscape.place_planes(renderer.model, view)
            renderer.update_scene(data, _camera(view), option)
            picture = renderer.render() if landscape is None else landscape.draw(renderer, view)
            pictures.write(picture.tobytes())
            pictures.flush()
    for each in (renderer, landscape):
        if each is not None:
            each.close()


def _received() -> tuple[str, Any] | None:
    """The next request; None at the end."""
    try:
        request: tuple[str, Any] = pickle.load(sys.stdin.buffer)
    except EOFError:
        return None
    return request


def _camera(view: View) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat[:] = view.lookat
    camera.distance, camera.azimuth, camera.elevation = view.distance, view.azimuth, view.elevation
    return camera
