"""A plant whose physics is MuJoCo: named vehicles in one compiled model, with their sensors.

A vehicle NAME is everything in the model whose name starts with ``NAME/``: its joints (slides and hinges) are its
state, (qpos, qvel), and its actuators, in the order of the model, its input. The plant steps the ``mujoco.MjModel``
itself and counts ticks in whole numbers, so that time does not drift.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from sim.loop import whole_ticks
from sim.protocols import Sensor
from sim.signals import Array, Event, Measurement

_SLIDE, _HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
_GROUND = (int(mujoco.mjtGeom.mjGEOM_HFIELD), int(mujoco.mjtGeom.mjGEOM_PLANE))
_ROUND_OFF = 1e-9  # relative excess of an input that is not worth an event


@dataclass(frozen=True)
class Equipment:
    """What a scenario gives a vehicle."""

    start: Array  # (nx,) the state at t = 0
    sensors: tuple[Sensor, ...] = ()
    input_max: float | Array = math.inf  # on the Euclidean norm of the input, or (nu,) on the magnitude of each one
    delay: float = 0.0  # [s] from a command to what the actuators do


@dataclass(frozen=True)
class JointMotion:
    """A ``sim.protocols.Motion``: views that follow the simulation."""

    q: Array  # (nq,) joint positions
    v: Array  # (nv,) joint velocities
    acceleration: Array  # (nv,) joint accelerations over the last tick, disturbances included

    @property
    def x(self) -> Array:
        """(nq + nv,) the state, a copy."""
        return np.concatenate((self.q, self.v))


@dataclass(frozen=True)
class _Mounted:
    """A sensor with what the plant needs to read it."""

    sensor: Sensor
    every: int  # ticks; 0: whenever the loop looks
    rng: np.random.Generator


class _Vehicle:
    """One vehicle's views into the simulation."""

    def __init__(
        self, name: str, equipment: Equipment, model: mujoco.MjModel, data: mujoco.MjData, rng: np.random.Generator
    ) -> None:
        self.name = name
        joints = [j for j in range(model.njnt) if model.joint(j).name.startswith(f"{name}/")]
        actuators = [i for i in range(model.nu) if model.actuator(i).name.startswith(f"{name}/")]
        if not joints:
            known = sorted({model.joint(j).name.partition("/")[0] for j in range(model.njnt)})
            raise ValueError(f"the model has no vehicle {name!r}; it has {known}")
        kinds = [int(model.jnt_type[j]) for j in joints]
        if not set(kinds) <= {_SLIDE, _HINGE}:
            raise ValueError(f"vehicle {name!r} has joints other than slides and hinges")
        q, v = _slice(model.jnt_qposadr[joints]), _slice(model.jnt_dofadr[joints])
        self.motion = JointMotion(data.qpos[q], data.qvel[v], data.qacc[v])
        self.control = data.ctrl[_slice(np.array(actuators))] if actuators else data.ctrl[:0]
        self.wrench = data.xfrc_applied[int(model.jnt_bodyid[joints[-1]])]  # force and torque, world frame
        self.slides = [(i, model.jnt_axis[j].copy()) for i, j in enumerate(joints) if kinds[i] == _SLIDE]
        self.geoms = frozenset(
            g for g in range(model.ngeom) if model.body(int(model.geom_bodyid[g])).name.startswith(f"{name}/")
        )
        names = [model.joint(j).name.partition("/")[2] for j in joints]
        units = ["m" if kind == _SLIDE else "rad" for kind in kinds]
        self.state_names = (
            *(f"position_{joint} [{unit}]" for joint, unit in zip(names, units, strict=True)),
            *(f"velocity_{joint} [{unit}/s]" for joint, unit in zip(names, units, strict=True)),
        )
        start = np.asarray(equipment.start, dtype=np.float64)
        if start.shape != (2 * len(joints),) or not np.isfinite(start).all():
            raise ValueError(f"vehicle {name!r}: start = {start.tolist()}; allowed: {2 * len(joints)} finite numbers")
        self.motion.q[:], self.motion.v[:] = start[: len(joints)], start[len(joints) :]
        self.bounded = _bound(name, equipment.input_max, len(actuators))
        self.delay = whole_ticks(equipment.delay, float(model.opt.timestep), "delay") if equipment.delay != 0.0 else 0
        self.underway: deque[tuple[int, Array]] = deque()  # (tick from which it acts, input), where there is a delay
        sensors = equipment.sensors
        if len({sensor.name for sensor in sensors}) != len(sensors):
            raise ValueError(f"vehicle {name!r} carries two sensors of one name: {[s.name for s in sensors]}")
        generators = rng.spawn(len(sensors))
        self.sensors = [
            _Mounted(sensor, _every(sensor, float(model.opt.timestep)), generator)
            for sensor, generator in zip(sensors, generators, strict=True)
        ]
        self.readings: list[Measurement] = []  # since the last look
        self.touched: frozenset[str] = frozenset()  # what it touches now
        self.contacts = 0
        self.clipped = False
        self.disturbed = False


class MujocoPlant:
    """Vehicles of a compiled MuJoCo model behind ``sim.protocols.Plant``."""

    def __init__(self, model: mujoco.MjModel, vehicles: Mapping[str, Equipment], rng: np.random.Generator) -> None:
        """The plant at t = 0; each sensor draws from a stream of its own, spawned from ``rng``.

        Raises ValueError if a vehicle is not in the model, its start does not fit its joints, or the rate of a sensor
        is not a whole number of ticks.
        """
        if not vehicles:
            raise ValueError("a plant needs at least one vehicle")
        self.model, self.data = model, mujoco.MjData(model)
        self.dt = float(model.opt.timestep)
        self._ticks = 0
        generators = rng.spawn(len(vehicles))
        self._vehicles = {
            name: _Vehicle(name, equipment, model, self.data, generator)
            for (name, equipment), generator in zip(vehicles.items(), generators, strict=True)
        }
        self._names = tuple(self._vehicles)
        self._touching = False  # any vehicle anything
        self._read_between: dict[int, tuple[_Vehicle, ...]] = {}
        self._owner = {geom: vehicle for vehicle in self._vehicles.values() for geom in vehicle.geoms}
        mujoco.mj_forward(model, self.data)

    @property
    def t(self) -> float:
        return self._ticks * self.dt

    @property
    def names(self) -> tuple[str, ...]:
        return self._names

    def state(self, name: str) -> Array:
        return self._vehicle(name).motion.x

    def state_names(self, name: str) -> tuple[str, ...]:
        return self._vehicle(name).state_names

    def sensor_sizes(self, name: str) -> dict[str, int]:
        return {mounted.sensor.name: mounted.sensor.size for mounted in self._vehicle(name).sensors}

    def contacts(self, name: str) -> int:
        """How often the vehicle has begun to touch something."""
        return self._vehicle(name).contacts

    def sense(self, name: str) -> Sequence[Measurement]:
        vehicle = self._vehicle(name)
        self._read(vehicle, looking=True)
        readings, vehicle.readings = vehicle.readings, []
        return readings

    def _read(self, vehicle: _Vehicle, *, looking: bool) -> None:
        """Read the sensors that fall due at this tick."""
        for mounted in vehicle.sensors:
            if self._ticks % mounted.every == 0 if mounted.every else looking:
                value = mounted.sensor.read(vehicle.motion, mounted.rng)
                if value is not None:
                    vehicle.readings.append(Measurement(mounted.sensor.name, self._ticks * self.dt, value))

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        vehicle = self._vehicle(name)
        vehicle.wrench[:3] += force
        if torque is not None:
            vehicle.wrench[3:] += torque
        vehicle.disturbed = True

    def displace(self, name: str, offset: Array) -> None:
        vehicle = self._vehicle(name)
        for i, axis in vehicle.slides:
            vehicle.motion.q[i] += float(axis @ offset)

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        """Advance by so many ticks with inputs and forces held; a vehicle without a command gets none.

        An input beyond its bound is brought back to it. That, and every contact, is an event when it begins:
        "input-clipped", "ground-contact", "vehicle-contact", "contact". Where actuators are late, an input acts from so
        many ticks later on; until the first one arrives there is none.
        """
        events: list[Event] = []
        for vehicle in self._vehicles.values():
            command = commands.get(vehicle.name)
            control = np.zeros_like(vehicle.control) if command is None else self._bounded(vehicle, command, events)
            if vehicle.delay:
                vehicle.underway.append((self._ticks + vehicle.delay, control.copy()))
            else:
                vehicle.control[:] = control
        late = tuple(vehicle for vehicle in self._vehicles.values() if vehicle.delay)
        # Looks of one rate fall on multiples of it, where there is little to read in between.
        between = self._between(ticks) if self._ticks % ticks == 0 else tuple(self._vehicles.values())
        for vehicle in between:
            vehicle.readings.clear()
        model, data = self.model, self.data
        for left in range(ticks - 1, -1, -1):
            for vehicle in late:
                while vehicle.underway and vehicle.underway[0][0] <= self._ticks:
                    vehicle.control[:] = vehicle.underway.popleft()[1]
            mujoco.mj_step(model, data)
            self._ticks += 1
            if data.ncon or self._touching:
                self._touch(events)
            if left:
                for vehicle in between:
                    self._read(vehicle, looking=False)
        data.time = self._ticks * self.dt
        for vehicle in self._vehicles.values():
            if vehicle.disturbed:
                vehicle.wrench[:] = 0.0
                vehicle.disturbed = False
        return events

    def _between(self, ticks: int) -> tuple[_Vehicle, ...]:
        """The vehicles with sensors to be read within steps of so many ticks; the rest is left to sense()."""
        if ticks not in self._read_between:
            vehicles = self._vehicles.values()
            self._read_between[ticks] = tuple(v for v in vehicles if any(m.every % ticks for m in v.sensors))
        return self._read_between[ticks]

    def _vehicle(self, name: str) -> _Vehicle:
        try:
            return self._vehicles[name]
        except KeyError:
            raise ValueError(f"the plant has no vehicle {name!r}; it has {list(self._names)}") from None

    def _bounded(self, vehicle: _Vehicle, command: Array, events: list[Event]) -> Array:
        """The command within its bound."""
        if command.shape != vehicle.control.shape:
            raise ValueError(
                f"vehicle {vehicle.name!r}: the command has shape {command.shape}; allowed is {vehicle.control.shape}"
            )
        if not math.isfinite(command.dot(command)):
            raise ValueError(
                f"vehicle {vehicle.name!r}: the command {command.tolist()} at {self.t:.3f} s is not finite"
            )
        control, clipped = vehicle.bounded(command)
        if clipped and not vehicle.clipped:
            events.append(Event(self.t, vehicle.name, "input-clipped", clipped))
        vehicle.clipped = bool(clipped)
        return control

    def _touch(self, events: list[Event]) -> None:
        """Contacts that began with this tick."""
        touching: dict[str, dict[str, str]] = {name: {} for name in self._names}  # vehicle -> what it touches -> kind
        for contact in self.data.contact:
            pair = int(contact.geom1), int(contact.geom2)
            for own, other in (pair, pair[::-1]):
                owner, stranger = self._owner.get(own), self._owner.get(other)
                if owner is None or owner is stranger:
                    continue
                if stranger is not None:
                    touching[owner.name][stranger.name] = "vehicle-contact"
                else:
                    ground = int(self.model.geom_type[other]) in _GROUND
                    touching[owner.name][self.model.geom(other).name] = "ground-contact" if ground else "contact"
        for vehicle in self._vehicles.values():
            now = touching[vehicle.name]
            for thing in sorted(now.keys() - vehicle.touched):
                where = np.round(vehicle.motion.q, 1).tolist()
                speed = float(np.linalg.norm(vehicle.motion.v))
                message = f"touches {thing} at {where} with {speed:.1f} m/s"
                events.append(Event(self.t, vehicle.name, now[thing], message))
                vehicle.contacts += 1
            vehicle.touched = frozenset(now)
        self._touching = any(touching.values())


def _bound(name: str, input_max: float | Array, size: int) -> Callable[[Array], tuple[Array, str]]:
    """What brings an input back to its bound, and says so; "" where there is nothing to say."""
    limits = np.asarray(input_max, dtype=np.float64)
    if limits.shape not in ((), (size,)) or not (limits > 0.0).all():
        raise ValueError(f"vehicle {name!r}: input_max = {input_max!r}; allowed: one number > 0, or {size} of them")

    def length_bounded(command: Array) -> tuple[Array, str]:
        length, longest = math.sqrt(command.dot(command)), float(limits)
        if length <= longest:
            return command, ""
        clipped = length > longest * (1.0 + _ROUND_OFF)
        message = f"an input of length {length:.6g} was shortened to {longest:.6g}" if clipped else ""
        return command * (longest / length), message

    def each_bounded(command: Array) -> tuple[Array, str]:
        excess = np.abs(command) > limits * (1.0 + _ROUND_OFF)
        message = f"the input {np.round(command, 6).tolist()} is beyond {limits.tolist()}" if excess.any() else ""
        return np.clip(command, -limits, limits), message

    return each_bounded if limits.shape else length_bounded


def _slice(indices: Array) -> slice:
    """The slice that holds these indices: a view into MuJoCo's arrays instead of a copy."""
    first, last = int(indices[0]), int(indices[-1])
    if last - first + 1 != len(indices):
        raise ValueError(f"the joints or actuators of a vehicle do not lie together in the model: {indices.tolist()}")
    return slice(first, last + 1)


def _every(sensor: Sensor, dt: float) -> int:
    """Ticks from one reading to the next, 0 for a sensor without a rate."""
    if sensor.rate is None:
        return 0
    if not (math.isfinite(sensor.rate) and sensor.rate > 0.0):
        raise ValueError(f"sensor {sensor.name!r}: rate = {sensor.rate!r} Hz; allowed: a finite rate > 0")
    return whole_ticks(1.0 / sensor.rate, dt, f"the period of sensor {sensor.name!r} at {sensor.rate!r} Hz")
