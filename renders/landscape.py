"""Background of a picture of an episode over a terrain: relief, haze and sky.

The physics has a grey ground, which costs nothing and looks like nothing. Here the ground of videos is drawn by the
same camera, with the same triangles as that of the physics, and all else of the physics' model before it: where its
depth is the nearer one.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.palette import Picture
from mathnavi.renders.scene.ground import ground_model
from mathnavi.renders.stage import Optics, Stage, View, nearness

_MOST_NODES = 1025  # of the ground, along its longer side
_SAMPLES, _DETAIL = 4, 2  # of a pixel; of the ground, finer ones than which would take seconds to prepare
_NEAR, _FAR = 0.02, 3.0  # clipping planes: in distances of the camera, and in extents of the ground beyond it
_AMBIENT, _DIFFUSE = 0.45, 0.5  # light on the vehicles, which is that of the ground


class Landscape:
    """Renderer of a terrain behind the vehicles of a model; close it when nothing more is drawn."""

    def __init__(self, terrain: HeightField, width: int, height: int) -> None:
        """``width`` and ``height`` in pixels."""
        nodes = min(max(terrain.z.shape), _MOST_NODES)
        model = ground_model(terrain, (1.0,), width, height, _SAMPLES, nodes, _DETAIL).compile()
        self._stage = Stage(model, width, height, glow=0.0)
        self._size = width, height

    def prepare(self, model: Any) -> None:
        """Hide the ground of the physics in a model, and light its vehicles, which must not be seen through."""
        ground, opacity = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD, model.geom_rgba[:, 3]
        opacity[opacity > 0.0] = 1.0  # what is seen through has no depth
        opacity[ground] = 0.0
        model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = _AMBIENT, _DIFFUSE

    def draw(self, renderer: Any, view: View) -> Picture:
        """The picture (height, width, 3) with what a renderer, whose scene is up to date, draws before the ground.

        The renderer's model is prepared, and ``place_planes`` was called before its scene was updated.
        """
        front: Picture = renderer.render()
        near = nearness(renderer, *self._size)
        extent = float(self._stage.model.stat.extent)
        planes = self._planes(view)
        field_of_view = float(renderer.model.vis.global_.fovy)
        self._stage.look(view, Optics(field_of_view, planes[0] / extent, planes[1] / extent), (0,))
        self._stage.begin(fog=True)
        behind = self._stage.end(sky=True)
        shown = near > self._stage.nearness()
        return np.where(shown[..., np.newaxis], front, behind)

    def place_planes(self, model: Any, view: View) -> None:
        """Set the clipping planes of a model to those of the ground, so that their depths compare."""
        extent = float(model.stat.extent)
        model.vis.map.znear, model.vis.map.zfar = (plane / extent for plane in self._planes(view))

    def _planes(self, view: View) -> tuple[float, float]:
        """Clipping planes [m]."""
        return _NEAR * view.distance, 2.0 * view.distance + _FAR * float(self._stage.model.stat.extent)

    def close(self) -> None:
        """Free the renderer."""
        self._stage.close()
