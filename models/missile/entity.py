"""Missile and range as dm_control entities, and the model composed of both.

The world frame has x ahead, y to the left and z up, metres: the thesis' Earth frame (X_e, Y_e, Z_e) turned by half a
turn about X_e. The ground lies at z = 0 and is drawn only: a referee decides where a flight ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco

from mathnavi.interfaces.errors import FieldError
from mathnavi.models.composer_and_mjcf import composer, mjcf
from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.missile.dynamics import NOMINAL, TICK, Body
from mathnavi.models.vehicle_names import check_vehicle_name

GROUND = 4000.0  # [m] half the side of the ground that is drawn
SQUARE = 50.0  # [m] of the pattern on the ground

_HERE = Path(__file__).parent


class Missile(composer.Entity):
    """The missile with the joints and thrusters of its coordinates."""

    def _build(  # the method that dm_control tells its users to override
        self,
        name: str,
        coordinates: Coordinates,
        body: Body,
        input_max: Sequence[float],
        force_factor: float,
        moment_factor: float,
    ) -> None:
        check_vehicle_name(name)
        for factor, what in ((force_factor, "force_factor"), (moment_factor, "moment_factor")):
            if not (math.isfinite(factor) and factor > 0.0):
                raise FieldError(f"{what} = {factor!r}; allowed: a finite value > 0")
        self._model = mjcf.from_path(str(_HERE / "missile.xml"))
        self._model.model = name
        self._model.option.gravity = (0.0, 0.0, -body.gravity)
        root = self._model.find("body", "body")
        root.inertial.mass = body.mass
        root.inertial.diaginertia = (body.axial_inertia, body.inertia, body.inertia)
        for joint in root.joint:
            if joint.name not in coordinates.joints:
                joint.remove()
        for motor in self._model.actuator.motor:
            if motor.name not in coordinates.inputs:
                motor.remove()
                continue
            limit = input_max[coordinates.inputs.index(motor.name)]
            if not limit > 0.0:
                raise FieldError(f"input_max of {motor.name} = {limit!r}; allowed: > 0")
            if math.isfinite(limit):
                motor.ctrlrange = (-limit, limit)
            motor.gear = motor.gear * (force_factor if motor.name.startswith("F") else moment_factor)

    @property
    def mjcf_model(self) -> Any:
        """MJCF model of the missile."""
        return self._model


class MissileRange(composer.Arena):
    """A plain with a target on it, a body ``target`` that is moved from outside."""

    def _build(self, gravity: float) -> None:  # the method that dm_control tells its users to override
        super()._build(name=None)
        root = self.mjcf_model
        root.model = "range"
        # The options of an arena and of what is attached to it must be the same.
        root.option.timestep, root.option.integrator, root.option.gravity = TICK, "RK4", (0.0, 0.0, -gravity)
        root.option.flag.autoreset = "disable"  # a state that diverges has to be visible, not reset to the origin
        texture = root.asset.add(
            "texture", name="ground", type="2d", builtin="checker", mark="edge", width=512, height=512,
            rgb1=(0.56, 0.60, 0.47), rgb2=(0.53, 0.57, 0.44), markrgb=(0.44, 0.48, 0.37),
        )  # fmt: skip
        material = root.asset.add(
            "material", name="ground", texture=texture, texrepeat=(1.0 / SQUARE, 1.0 / SQUARE), texuniform="true",
            specular=0.0, shininess=0.0,
        )  # fmt: skip
        root.worldbody.add(
            "geom", name="ground", type="plane", size=(GROUND, GROUND, 100.0), material=material,
            contype=0, conaffinity=0, group=1,
        )  # fmt: skip
        target = root.worldbody.add("body", name="target", mocap="true")
        for ring, (radius, colour) in enumerate(
            ((6.0, (0.95, 0.95, 0.93, 1.0)), (4.0, (0.83, 0.13, 0.10, 1.0)), (2.0, (0.95, 0.95, 0.93, 1.0)))
        ):
            target.add(
                "geom", name=f"ring_{ring}", type="cylinder", size=(radius, 0.03), pos=(0.0, 0.0, 0.06 + 0.08 * ring),
                rgba=colour, contype=0, conaffinity=0, mass=0, group=2,
            )  # fmt: skip
        root.statistic.center, root.statistic.extent = (350.0, 0.0, 60.0), 500.0
        root.visual.map.znear, root.visual.map.zfar = 1e-3, 40.0  # in units of the extent


def build_spec(
    coordinates: Coordinates,
    input_max: Sequence[float],
    body: Body = NOMINAL,
    *,
    name: str = "missile",
    force_factor: float = 1.0,
    moment_factor: float = 1.0,
) -> Any:
    """Build the ``mujoco.MjSpec`` of a missile over its range, not compiled yet.

    The vehicle NAME has the body ``NAME/body``, the joints of ``coordinates.joints`` and the motors of
    ``coordinates.inputs``, in those orders; ``input_max`` (nu,) bounds the magnitude of each input [N, N m], and the
    factors are the thrust over the commanded one. The body is the true one.
    """
    if len(input_max) != coordinates.input_size:
        raise FieldError(f"input_max has {len(input_max)} numbers; allowed: {coordinates.input_size}")
    arena = MissileRange(body.gravity)
    arena.attach(Missile(name, coordinates, body, input_max, force_factor, moment_factor))
    root = arena.mjcf_model
    return mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets())


def build_model(coordinates: Coordinates, input_max: Sequence[float], body: Body = NOMINAL, **more: Any) -> Any:
    """Compile the ``mujoco.MjModel`` of ``build_spec``."""
    return build_spec(coordinates, input_max, body, **more).compile()
