"""The unicycle robot as a dm_control entity, and its model within a wall."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import mujoco

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.composer_and_mjcf import composer, mjcf
from mathnavi.models.field.arena import SENSOR_HEIGHT, FieldArena
from mathnavi.models.field.wall import Wall
from mathnavi.models.unicycle.mission import TICK
from mathnavi.models.vehicle_names import check_vehicle_name

DriveName = Literal["ideal", "differential"]

RADIUS = 0.16
"""radius [m] of the robot's bumper"""

FLOOR = "floor"
_BEACON = 0.04  # [m] radius of the site of a beacon

_ROLLS_BY = ("height", "pitch", "roll")  # joints that the ideal robot lacks
_HERE = Path(__file__).parent


class Unicycle(composer.Entity):
    """A robot with a rangefinder ``range_I`` for each of ``rays`` (l, 3) [rad, m, m]: angle off its heading, and place.

    ``friction`` is that of the wheels of the differential drive.
    """

    # The method that dm_control tells its users to override.
    def _build(self, name: str, rays: Array, drive: DriveName, friction: float) -> None:
        check_vehicle_name(name)
        if not (math.isfinite(friction) and friction > 0.0):
            raise FieldError(f"friction = {friction!r}; allowed: a finite value > 0")
        self._model = mjcf.from_path(str(_HERE / "unicycle.xml"))
        self._model.model = name
        chassis = self._model.find("body", "chassis")
        if drive == "ideal":
            option = self._model.option
            option.timestep, option.integrator, option.gravity = TICK, "Euler", (0.0, 0.0, 0.0)
            for joint in _ROLLS_BY:
                self._model.find("joint", joint).remove()
            for servo in self._model.actuator.velocity:
                servo.remove()
            for geom in self._model.find_all("geom"):
                if geom.conaffinity == 1:
                    geom.conaffinity = 0  # it does not stand on the floor
        else:
            for side in ("left", "right"):
                self._model.find("geom", f"tread_{side}").friction = (friction, 0.0, 0.0)
        for i, (angle, x, y) in enumerate(rays.tolist()):
            site = chassis.add(
                "site", name=f"range_{i}", pos=(x, y, SENSOR_HEIGHT), zaxis=(math.cos(angle), math.sin(angle), 0.0),
                size=(0.004,), group=4,
            )  # fmt: skip
            self._model.sensor.add("rangefinder", name=f"range_{i}", site=site)

    @property
    def mjcf_model(self) -> Any:
        """MJCF model of the robot."""
        return self._model


def build_spec(
    curve: Wall,
    rays: Array,
    drive: DriveName = "ideal",
    friction: float = 1.0,
    *,
    name: str = "robot",
    beacons: Sequence[tuple[float, float]] = (),
) -> Any:
    """Build the ``mujoco.MjSpec`` of a robot within a wall, not compiled yet; ``beacons`` (n, 2) [m] become sites.

    The vehicle NAME has the joints ``NAME/x_1``, ``NAME/x_2``, ``NAME/phi`` first and ``NAME/wheel_left``,
    ``NAME/wheel_right`` last, the sites ``beacon_I``, the sensors ``NAME/range_I`` and, of the angles [rad] of the
    wheels, ``NAME/wheel_left`` and ``NAME/wheel_right``.
    """
    arena = FieldArena(curve)
    robot = Unicycle(name, rays, drive, friction)
    root = arena.mjcf_model
    # The options of an arena and of what is attached to it must be the same.
    for option in ("timestep", "integrator", "gravity", "cone", "impratio"):
        setattr(root.option, option, getattr(robot.mjcf_model.option, option))
    root.option.flag.autoreset = "disable"  # a state that diverges has to be visible, not reset to the origin
    root.option.flag.sensor = "disable"  # rays are cast when a sensor is read, not at every tick
    root.compiler.autolimits = True
    for i, (x, y) in enumerate(beacons):
        root.worldbody.add(
            "site", name=f"beacon_{i}", pos=(x, y, SENSOR_HEIGHT), size=(_BEACON,), rgba=(0.85, 0.35, 0.1, 1.0)
        )
    arena.attach(robot)
    return mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets())


def build_model(
    curve: Wall,
    rays: Array,
    drive: DriveName = "ideal",
    friction: float = 1.0,
    *,
    name: str = "robot",
    beacons: Sequence[tuple[float, float]] = (),
) -> Any:
    """Compile the ``mujoco.MjModel`` of ``build_spec``."""
    return build_spec(curve, rays, drive, friction, name=name, beacons=beacons).compile()
