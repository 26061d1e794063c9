"""The aerial vehicle and the ground under it as dm_control entities, and the model composed of both.

The world frame is the map frame: x east, y north of the map's south-west corner, z above sea level, metres. A fleet
is one arena with as many vehicles attached as it has names; ``build_model`` compiles the ``mujoco.MjModel`` to step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.composer_and_mjcf import composer, mjcf
from mathnavi.models.cross_product import cross
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.vehicle_names import check_vehicle_name, check_vehicle_names

GRAVITY = 9.81  # [m/s^2] the weight that the rotors carry; only the drawn tilt depends on it
BASE = 200.0  # [m] of rock below the lowest node: a fast vehicle must not pass through the ground between two ticks

_HERE = Path(__file__).parent


class AerialVehicle(composer.Entity):
    """A unit point mass with a force of at most ``acceleration_max`` [m/s^2] on each axis, and its drawn airframe."""

    # The method that dm_control tells its users to override.
    def _build(self, name: str, acceleration_max: float) -> None:
        check_vehicle_name(name)
        if not (math.isfinite(acceleration_max) and acceleration_max > 0.0):
            raise FieldError(f"acceleration_max = {acceleration_max!r} m/s^2; allowed: a finite value > 0")
        self._model = mjcf.from_path(str(_HERE / "point_mass.xml"))
        self._model.model = name
        for motor in self._model.actuator.motor:
            motor.ctrlrange = (-acceleration_max, acceleration_max)
        self.airframe = mjcf.from_path(str(_HERE / "airframe.xml"))
        self.airframe.model = _airframe_scope(name)

    @property
    def mjcf_model(self) -> Any:
        """MJCF model of the vehicle."""
        return self._model


class TerrainArena(composer.Arena):
    """The triangles of a height field, in the map frame."""

    def _build(self, height_field: HeightField) -> None:  # the method that dm_control tells its users to override
        super()._build(name=None)
        low, high = float(height_field.z.min()), float(height_field.z.max())
        east, north = 0.5 * height_field.width, 0.5 * height_field.depth
        root = self.mjcf_model
        root.model = "terrain"
        # The options of an arena override those of what is attached to it, so the vehicle's are repeated here.
        root.option.timestep, root.option.integrator, root.option.gravity = TICK, "RK4", (0.0, 0.0, 0.0)
        root.option.flag.autoreset = "disable"  # a state that diverges has to be visible, not reset to the origin
        root.asset.add(
            "hfield",
            name="terrain",
            size=(east, north, max(high - low, 1e-3), BASE),  # MuJoCo refuses a height of zero, which a plain has
            file=mjcf.Asset(_elevation_file(height_field.z), ".hf"),
        )
        root.worldbody.add(
            "geom",
            name="terrain",
            type="hfield",
            hfield="terrain",
            pos=(east, north, low),
            rgba=(0.45, 0.46, 0.40, 1.0),
        )
        root.statistic.center = (east, north, 0.5 * (low + high))
        root.statistic.extent = max(east, north)
        root.visual.map.znear, root.visual.map.zfar = 2e-4, 5.0  # in units of the extent

    def add_vehicle(self, vehicle: AerialVehicle) -> None:
        """Attach a vehicle; its airframe is a child of the world, as MuJoCo requires of a mocap body."""
        self.attach(vehicle)
        self.mjcf_model.attach(vehicle.airframe).mocap = "true"


def build_model(height_field: HeightField, names: Sequence[str], acceleration_max: float) -> mujoco.MjModel:
    """Compile the model of vehicles ``names`` over a terrain.

    Vehicle NAME has the body ``NAME/body``, the joints and motors ``NAME/x``, ``NAME/y``, ``NAME/z`` and the mocap body
    ``NAME/airframe``; the ground is the geom ``terrain``.
    """
    check_vehicle_names(names)
    arena = TerrainArena(height_field)
    for name in names:
        arena.add_vehicle(AerialVehicle(name, acceleration_max))
    root = arena.mjcf_model
    spec = mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets())
    for name in names:
        spec.body(f"{_airframe_scope(name)}/").name = f"{name}/airframe"
    return spec.compile()


def airframe_pose(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array]:
    """Pose in which a vehicle is drawn: position (3,) [m] and unit quaternion (4,), scalar first.

    ``position`` (3,) [m], ``velocity`` (3,) [m/s] and ``acceleration`` (3,) [m/s^2] are in the map frame. The thrust
    axis b_z points along acceleration + g e_z and the nose b_x lies in the vertical plane of the velocity. At rest and
    in vertical flight that is the plane of the acceleration; where that is vertical too, it is east.
    """
    thrust = np.array([acceleration[0], acceleration[1], acceleration[2] + GRAVITY])
    length = float(np.linalg.norm(thrust))
    up = thrust / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    heading = np.array([1.0, 0.0, 0.0])
    for candidate in (velocity, acceleration):
        if math.hypot(candidate[0], candidate[1]) > 1e-3:
            heading = np.array([candidate[0], candidate[1], 0.0])
            break
    side = cross(up, heading)
    if float(np.linalg.norm(side)) <= 1e-9 * float(np.linalg.norm(heading)):  # the thrust points along the heading
        side = np.array([-heading[1], heading[0], 0.0])
    side /= np.linalg.norm(side)
    rotation = np.array([cross(side, up), side, up]).T  # columns b_x, b_y, b_z
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.reshape(9))
    return np.array(position, dtype=np.float64), quaternion


def _airframe_scope(name: str) -> str:
    return f"{name}.airframe"


def _elevation_file(z: Array) -> bytes:
    """MuJoCo's binary height field: rows, columns (int32), then the heights (float32), south-west first."""
    return np.array(z.shape, "<i4").tobytes() + z.astype("<f4").tobytes()
