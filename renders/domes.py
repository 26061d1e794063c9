"""Domes of radars over the two worlds of ``mathnavi.renders.landscape``, at their places and while they are on.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import RadarTrack
from mathnavi.renders.landscape import WORLDS, Landscape
from mathnavi.renders.palette import COLOURS, SceneElement


def add_domes(spec: Any, terrain: HeightField, radars: Sequence[RadarTrack]) -> None:
    """Add a dome for each radar in each world of an ``mjSpec``, still invisible."""
    if radars:
        spec.add_material(name="radar", emission=0.8, specular=0.0)
    land = Landscape(terrain)
    for k, track in enumerate(radars):
        radar = track.radar
        foot = np.array([radar.x, radar.y, float(terrain.height(radar.x, radar.y))])
        for group, name, factor in WORLDS:
            mesh = spec.add_mesh(name=f"radar {k} {name}", scale=[radar.radius, radar.radius, factor * radar.radius])
            mesh.make_sphere(subdivision=4)
            spec.worldbody.add_geom(
                name=f"radar {k} {name}", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name,
                pos=foot if factor == 1.0 else land.tall(foot), material="radar",
                rgba=[*COLOURS[SceneElement.RADAR], 0.0],
                group=group, contype=0, conaffinity=0,
            )  # fmt: skip


def place_domes(model: Any, terrain: HeightField, radars: Sequence[RadarTrack], t: float, opacity: float) -> None:
    """Place the domes of a model at the radars at ``t`` [s]; those of radars that are off are invisible."""
    land = Landscape(terrain)
    for k, track in enumerate(radars):
        radar = track.at(t, terrain)
        for _, name, factor in WORLDS:
            dome = model.geom(f"radar {k} {name}")
            dome.rgba[3] = 0.0 if radar is None else opacity
            if radar is not None:
                foot = np.array([radar.x, radar.y, float(terrain.height(radar.x, radar.y))])
                dome.pos = foot if factor == 1.0 else land.tall(foot)
