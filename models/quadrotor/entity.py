"""The quadrotor over the ground as one MuJoCo model, its drive, and the camera that follows it.

The world frame is the map frame: x east, y north of the map's south-west corner, z above sea level, metres. A fleet is
one arena with as many vehicles attached as it has names. Physics tick and integrator are those of the aerial vehicle;
unlike there, weight and rotors are part of the physics.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.reading.mechanisms import read_spec
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.entity import TerrainArena
from mathnavi.models.quadrotor.dynamics import NOMINAL, ROTOR_COUNT, ROTORS, Quadrotor
from mathnavi.models.quaternion import rotation_entries
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.vehicle_names import check_vehicle_names

_XML = Path(__file__).parent / "quadrotor.xml"
_AXES = "xyz"
REACH = 0.335
"""distance [m] from the centre to the farthest point that collides"""


def build_spec(
    height_field: HeightField, names: Sequence[str], vehicles: Quadrotor | Mapping[str, Quadrotor] = NOMINAL
) -> Any:
    """Build the ``mujoco.MjSpec`` of quadrotors ``names`` over a terrain, not compiled yet.

    ``vehicles`` are the true parameters: the same for all, or by name. Vehicle NAME has the body
    ``NAME/body``, the free joint ``NAME/pose``, the rotors ``NAME/front_left`` and so on in the order of ``ROTORS`` and
    after them the dampers ``NAME/drag_x`` and so on; the ground is the geom ``terrain``. Gravity is one for all.

    ValueError for names that are not allowed, or for vehicles that differ in gravity.
    """
    check_vehicle_names(names)
    each = {name: vehicles if isinstance(vehicles, Quadrotor) else vehicles[name] for name in names}
    gravities = {vehicle.gravity for vehicle in each.values()}
    if len(gravities) > 1:
        raise FieldError(f"gravity = {sorted(gravities)}; allowed: the same for every vehicle of a model")
    root = TerrainArena(height_field).mjcf_model
    spec = mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets())
    spec.option.gravity = (0.0, 0.0, -gravities.pop())
    _light(spec)
    for name, vehicle in each.items():
        add_vehicle(spec, name, vehicle)
    return spec


def add_vehicle(spec: Any, name: str, vehicle: Quadrotor = NOMINAL) -> None:
    """Attach a quadrotor to a world."""
    one = read_spec(_XML, ValueError)
    for setting in ("gravity", "timestep", "integrator"):  # those of the world hold
        setattr(one.option, setting, getattr(spec.option, setting))
    _set_parameters(one, vehicle)
    spec.worldbody.add_frame().attach_body(one.body("body"), f"{name}/", "")


def build_model(
    height_field: HeightField, names: Sequence[str], vehicles: Quadrotor | Mapping[str, Quadrotor] = NOMINAL
) -> mujoco.MjModel:
    """Compile the model of ``build_spec``."""
    return build_spec(height_field, names, vehicles).compile()


def _light(spec: Any) -> None:
    """Add daylight: the sun in the south-east, a sky, and grass instead of rock."""
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = (0.38, 0.38, 0.40), (0.25, 0.25, 0.25)
    spec.worldbody.add_light(
        name="sun", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=(-0.5, 0.6, -0.9), diffuse=(0.65, 0.63, 0.58),
        specular=(0.2, 0.2, 0.2), castshadow=False,
    )  # fmt: skip
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.36, 0.56, 0.82), rgb2=(0.88, 0.92, 0.95), width=128, height=768,
    )  # fmt: skip
    spec.geom("terrain").rgba = (0.50, 0.56, 0.40, 1.0)


def _set_parameters(spec: Any, vehicle: Quadrotor) -> None:
    body = spec.body("body")
    body.mass, body.inertia = vehicle.mass, vehicle.inertia
    for rotor, (x, y), moment in zip(ROTORS, vehicle.places, vehicle.moments, strict=True):
        hub, actuator = spec.body(rotor), spec.actuator(rotor)
        hub.pos = (x, y, hub.pos[2])
        actuator.gear = (0.0, 0.0, 1.0, 0.0, 0.0, moment)
        actuator.dynprm[0] = vehicle.motor_lag
        actuator.biasprm[0] = vehicle.hover_thrust
        # In terms of the control, which is counted from hover.
        actuator.ctrlrange = (-vehicle.hover_thrust, vehicle.thrust_max - vehicle.hover_thrust)
    for axis, coefficient in zip(_AXES, vehicle.drag, strict=True):
        spec.actuator(f"drag_{axis}").biasprm[2] = -coefficient


@dataclass(frozen=True)
class RotorDrive:
    """``mathnavi.interfaces.protocols.ActuatorModel``: the input is the commanded thrust of each rotor [N], the
    model's controls count from hover.

    So a new model hovers, and the dampers behind the rotors are not an input.
    """

    vehicle: Quadrotor = NOMINAL  # the true one
    input_size: int = ROTOR_COUNT

    def act(self, u: Array, q: Array, v: Array, control: Array, dt: float) -> None:
        """Write the thrusts u (4,) [N], clipped to their bounds, to the model's controls, which count from hover."""
        control[:ROTOR_COUNT] = np.clip(u, 0.0, self.vehicle.thrust_max) - self.vehicle.hover_thrust


def tilt(quaternion: Array) -> float:
    """Angle [rad] between the thrust and the vertical at an attitude (4,), scalar first."""
    upright = float(rotation_entries(*quaternion)[2][2])  # of the thrust's direction
    return math.acos(min(1.0, max(-1.0, upright)))
