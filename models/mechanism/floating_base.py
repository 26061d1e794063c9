"""The floating base of a mechanism, and the sensors that replace a reading of its pose: an IMU and foot switches.

The base is the body of the one free joint, which comes first. Its IMU is a ``<gyro>`` and an ``<accelerometer>`` of the
MJCF at one site of that body, with the ``noise`` of both as standard deviations; it reads, in the site's axes,

    omega + n_g    and    R' (a + g) + n_a,

a being the acceleration of the site over the last tick and g that of gravity, upwards. A ``<touch>`` sensor at a site
of any other body makes it a foot, which reads 1 while it touches something that is not part of a mechanism, else 0; a
sphere about that site is a foot that rolls. The joints are read by their encoders.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from typing import ClassVar

import mujoco
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.joint_states import FREE
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.cross_product import cross
from mathnavi.models.manifold.mission import ManifoldPositionSensor
from mathnavi.models.quaternion import rotation

JOINTS, IMU, FEET = "joints", "imu", "feet"  # the names of the readings
PLACE, ATTITUDE, JOINT_POSITIONS = slice(0, 3), slice(3, 7), slice(7, None)  # in q
VELOCITY, RATE, JOINT_RATES = slice(0, 3), slice(3, 6), slice(6, None)  # in v

_GYRO, _ACCELEROMETER = int(mujoco.mjtSensor.mjSENS_GYRO), int(mujoco.mjtSensor.mjSENS_ACCELEROMETER)
_CENTRED = 1e-3  # [m]
_TOUCH = int(mujoco.mjtSensor.mjSENS_TOUCH)


@dataclass(frozen=True, eq=False)
class FloatingBase:
    """The base of a model (nq,), (nv,), its IMU and its feet."""

    model: mujoco.MjModel
    mounting: Array  # (3, 3) R of the IMU's axes in those of the base
    offset: Array  # (3,) [m] of the IMU in the axes of the base
    gyro: float  # [rad/s] standard deviation of a reading
    accelerometer: float  # [m/s^2] standard deviation of a reading
    feet: tuple[int, ...]  # sites
    radii: tuple[float, ...]  # [m] of the feet, 0 of those that do not roll

    @staticmethod
    def from_model(model: mujoco.MjModel) -> FloatingBase:
        """Read the base of a model. Raises FieldError for a model without a base or without its IMU."""
        free = np.flatnonzero(model.jnt_type == FREE)
        if free.tolist() != [0]:
            raise FieldError(
                f"system = a mechanism with {len(free)} free joints; allowed for floating_base_iekf: one, the first; "
                "riemannian_observer reads every joint"
            )
        base = int(model.jnt_bodyid[0])
        gyro, accelerometer = (_at(model, base, kind) for kind in (_GYRO, _ACCELEROMETER))
        name = model.body(base).name.rpartition("/")[2]
        if gyro is None or accelerometer is None or model.sensor_objid[gyro] != model.sensor_objid[accelerometer]:
            raise FieldError(
                f"system = a mechanism without an IMU on its base {name!r}; allowed for "
                "floating_base_iekf: a <gyro> and an <accelerometer> at one site of it; riemannian_observer reads "
                "its pose instead"
            )
        site = int(model.sensor_objid[gyro])
        feet = [int(s) for s in model.sensor_objid[model.sensor_type == _TOUCH] if model.site_bodyid[s] != base]
        noise = [float(model.sensor_noise[each]) for each in (gyro, accelerometer)]
        return FloatingBase(
            copy.copy(model), rotation(model.site_quat[site]), model.site_pos[site].copy(), noise[0], noise[1],
            tuple(feet), tuple(_radius(model, site) for site in feet),
        )  # fmt: skip

    @property
    def gravity(self) -> Array:
        """Acceleration (3,) [m/s^2] of free fall."""
        fall: Array = self.model.opt.gravity.copy()
        return fall

    @property
    def has_joints(self) -> bool:
        """True if the model has joints other than that of the base."""
        return bool(self.model.njnt > 1)


@dataclass(frozen=True)
class BaseImu:
    """Sensor of "imu" (6,): rate [rad/s] and specific force [m/s^2] of the base's IMU, in its axes."""

    base: FloatingBase
    rate: float | None  # [Hz]
    name: ClassVar[str] = IMU
    size: ClassVar[int] = 6

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read rate and specific force (6,) of ``motion``; ``rng`` draws the noise."""
        base, nq, n = self.base, self.base.model.nq, rng.standard_normal(6)
        x, turned, r = motion.x, motion.acceleration[RATE], self.base.offset
        R, omega = rotation(x[ATTITUDE]), x[nq:][RATE]
        force = R.T @ (motion.acceleration[VELOCITY] - base.gravity)
        force += cross(turned, r) + cross(omega, cross(omega, r))
        exact = base.mounting.T @ np.column_stack([omega, force])
        return np.concatenate([exact[:, 0] + base.gyro * n[:3], exact[:, 1] + base.accelerometer * n[3:]])


@dataclass(frozen=True)
class JointEncoders:
    """Sensor of "joints" (nq - 7,): the encoders of a mechanism, without the pose of its base."""

    position: ManifoldPositionSensor  # of all of it
    name: ClassVar[str] = JOINTS

    @property
    def rate(self) -> float | None:
        """Rate [Hz] of the encoders."""
        return self.position.rate

    @property
    def size(self) -> int:
        """Components of a reading."""
        return self.position.size - JOINT_POSITIONS.start

    @property
    def quaternions(self) -> tuple[slice, ...]:
        """Places of the quaternions of ball joints in a reading."""
        first = JOINT_POSITIONS.start
        return tuple(slice(each.start - first, each.stop - first) for each in self.position.quaternions[1:])

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the joints (nq - 7,), with noise, jumps and rounding; None where the reading is lost."""
        y = self.position.read(motion, rng)
        return None if y is None else y[JOINT_POSITIONS]


@dataclass(frozen=True)
class FootSwitches:
    """Sensor of "feet" (k,): 1 for each foot that touches something that is not part of a mechanism, else 0."""

    base: FloatingBase
    rate: float | None  # [Hz]
    name: ClassVar[str] = FEET
    data: mujoco.MjData = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", mujoco.MjData(self.base.model))

    @property
    def size(self) -> int:
        """Number k of feet."""
        return len(self.base.feet)

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the switches (k,), without noise."""
        model, data = self.base.model, self.data
        data.qpos[:] = motion.x[: model.nq]
        mujoco.mj_fwdPosition(model, data)
        bodies = model.geom_bodyid[data.contact.geom]
        touching = bodies[np.any(bodies == 0, axis=1) & (data.contact.dist <= 0.0)]
        return np.isin(model.site_bodyid[list(self.base.feet)], touching).astype(np.float64)


def _radius(model: mujoco.MjModel, site: int) -> float:
    """Radius [m] of the sphere about a site of the same body; 0 if the site has no sphere."""
    spheres = (model.geom_bodyid == model.site_bodyid[site]) & (model.geom_type == int(mujoco.mjtGeom.mjGEOM_SPHERE))
    centred = np.linalg.norm(model.geom_pos - model.site_pos[site], axis=1) < _CENTRED
    return float(model.geom_size[spheres & centred, 0].max(initial=0.0))


def _at(model: mujoco.MjModel, base: int, kind: int) -> int | None:
    """First sensor of a kind at a site of the base; None if there is no such sensor."""
    for i in np.flatnonzero(model.sensor_type == kind).tolist():
        if int(model.site_bodyid[model.sensor_objid[i]]) == base:
            return int(i)
    return None
