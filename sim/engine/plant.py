"""Plant whose physics is MuJoCo: named vehicles in one compiled model, with their sensors.

A vehicle NAME is everything in the model whose name starts with ``NAME/``: its joints are its state, (qpos, qvel), as
in ``mathnavi.interfaces.joint_states``, and its actuators, in the order of the model, its input, unless there is
an actuator model in between. The plant steps the ``mujoco.MjModel`` itself and counts ticks in whole numbers, so that
time does not drift.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.joint_states import (
    FREE,
    SIZES,
    SLIDE,
    activations,
    quaternions,
    state_groups,
    state_names,
    with_unit_quaternions,
)
from mathnavi.interfaces.model_signals import input_names, reading_names
from mathnavi.interfaces.protocols import ActuatorModel, Sensor
from mathnavi.interfaces.signal_names import UNNAMED, SignalNames
from mathnavi.interfaces.signals import Array, Event, Measurement
from mathnavi.sim.engine.contact_free import ContactFree
from mathnavi.sim.engine.contact_messages import thing_named, touching
from mathnavi.sim.engine.input_bounds import input_bound
from mathnavi.sim.engine.loop import whole_ticks
from mathnavi.sim.engine.mujoco_sensors import OwnSensors
from mathnavi.sim.engine.sensing import mounted
from mathnavi.sim.engine.simulation_warnings import SimulationWarnings

_GROUND = (int(mujoco.mjtGeom.mjGEOM_HFIELD), int(mujoco.mjtGeom.mjGEOM_PLANE))
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)  # the whole state on which the next steps depend


@dataclass(frozen=True)
class VehicleSetup:
    """Start, sensors and actuation of a vehicle."""

    start: Array  # (nx,) the state at t = 0
    sensors: tuple[Sensor, ...] = ()
    input_max: float | Array = math.inf  # on the Euclidean norm of the input, or (nu,) on the magnitude of each one
    delay: float = 0.0  # [s] from a command to its effect on the actuators
    drive: ActuatorModel | None = None  # None: the input is that of the actuators
    # geoms of others that it touches in normal operation, which is not an event: the floor of what stands or rolls
    ignored_contacts: tuple[str, ...] = ()
    signals: SignalNames = UNNAMED  # in the place of the names that follow from the model


@dataclass(frozen=True)
class Layout:
    """Places of a vehicle in MuJoCo's arrays, and the way of its input there, for other code that steps the model."""

    q: slice  # of qpos
    v: slice  # of qvel
    actuators: slice  # of ctrl
    input_size: int  # nu
    bounded: Callable[[Array], tuple[Array, str]]  # bounds to which an input (nu,) is clipped
    drive: ActuatorModel | None  # None: the input is that of the actuators
    delay: int  # [ticks]


@dataclass(frozen=True)
class JointMotion:
    """State view (``mathnavi.interfaces.protocols.StateView``): views that follow the simulation."""

    q: Array  # (nq,) joint positions
    v: Array  # (nv,) joint velocities
    acceleration: Array  # (nv,) joint accelerations over the last tick, disturbances included
    sensed: Callable[[str], Array]  # the present reading of one of MuJoCo's sensors, by its name

    @property
    def x(self) -> Array:
        """State (nq + nv,), a copy."""
        return np.concatenate((self.q, self.v))


class _Vehicle:
    """Views of one vehicle into the simulation."""

    def __init__(
        self,
        name: str,
        setup: VehicleSetup,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        rng: np.random.Generator,
        sensed: Callable[[str], Array],
    ) -> None:
        self.name = name
        joints = [j for j in range(model.njnt) if model.joint(j).name.startswith(f"{name}/")]
        actuators = [i for i in range(model.nactuator) if model.actuator(i).name.startswith(f"{name}/")]
        if not joints:
            known = sorted({model.joint(j).name.partition("/")[0] for j in range(model.njnt)})
            raise ArgumentError(f"the model has no vehicle {name!r}; it has {known}")
        kinds = [int(model.jnt_type[j]) for j in joints]
        positions, velocities = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        q = _slice(joints, int(positions[0]), int(positions[-1]) + SIZES[kinds[-1]][0])
        v = _slice(joints, int(velocities[0]), int(velocities[-1]) + SIZES[kinds[-1]][1])
        self.motion = JointMotion(data.qpos[q], data.qvel[v], data.qacc[v], sensed)
        first, count = model.actuator_ctrladr[actuators], model.actuator_ctrlnum[actuators]
        control = _slice(actuators, int(first[0]), int(first[-1] + count[-1])) if actuators else slice(0)
        self.actuators = data.ctrl[control]
        self.drive = setup.drive
        self.control = np.zeros(self.drive.input_size) if self.drive else self.actuators  # the input that acts
        self.wrench = data.xfrc_applied[int(model.jnt_bodyid[joints[0]])]  # force and torque, world frame
        self.slides: list[tuple[int, Array]] = []  # indices in q, and axes: a free joint begins with three
        self.slide_rates: list[int] = []
        for j, kind in zip(joints, kinds, strict=True):
            axes = {SLIDE: model.jnt_axis[j : j + 1].copy(), FREE: np.eye(3)}.get(kind, np.empty((0, 3)))
            first, rate = int(model.jnt_qposadr[j]) - q.start, int(model.jnt_dofadr[j]) - v.start
            self.slides += [(first + k, axis) for k, axis in enumerate(axes)]
            self.slide_rates += [rate + k for k in range(len(axes))]
        self.quaternions = quaternions(model, joints)
        self.geoms = frozenset(
            g for g in range(model.ngeom) if model.body(int(model.geom_bodyid[g])).name.startswith(f"{name}/")
        )
        self.ignored_contacts = frozenset(setup.ignored_contacts)
        self.signals = self._named(model, joints, actuators, setup)
        self.state_names = self.signals.states
        self.activations, self.activation_names = activations(model, actuators)
        self.place(setup.start, "start")
        self.bounded = input_bound(name, setup.input_max, len(self.control), self.signals.inputs)
        self.delay = whole_ticks(setup.delay, float(model.opt.timestep), "delay") if setup.delay != 0.0 else 0
        self.layout = Layout(q, v, control, len(self.control), self.bounded, self.drive, self.delay)
        self.underway: deque[tuple[int, Array]] = deque()  # (tick from which it acts, input), if there is a delay
        self.sensors = mounted(name, setup.sensors, float(model.opt.timestep), rng)
        self.readings: list[Measurement] = []  # since the last sample
        self.touched: frozenset[str] = frozenset()  # geoms that it touches now
        self.contacts = 0
        self.clipped = False
        self.disturbed = False

    def _named(
        self, model: mujoco.MjModel, joints: Sequence[int], actuators: Sequence[int], setup: VehicleSetup
    ) -> SignalNames:
        """Names of the vehicle's signals: those that are declared, else those in the model."""
        states, sizes = state_names(model, joints), {sensor.name: sensor.size for sensor in setup.sensors}
        inputs = () if self.drive else tuple(each for i in actuators for each in input_names(model, i))
        own = {f"{self.name}/{sensor.name}": sensor.name for sensor in setup.sensors}
        in_model = {
            own[full]: names
            for i in range(model.nsensor)
            if (full := model.sensor(i).name) in own and len(names := reading_names(model, i)) == sizes[own[full]]
        }
        stated = {sensor.name: names for sensor in setup.sensors if (names := tuple(getattr(sensor, "numbers", ())))}
        of_model = SignalNames(states, inputs, {**in_model, **stated}, groups=state_groups(model, joints))
        declared = setup.signals.checked(f"vehicle {self.name!r}", len(states), len(self.control), sizes)
        return declared.over(of_model)

    def place(self, state: Array, what: str) -> None:
        """Set the joints; ArgumentError for a state that does not fit them, e.g. a quaternion not of length 1."""
        x, nq, size = np.asarray(state, dtype=np.float64), len(self.motion.q), len(self.state_names)
        if x.shape != (size,) or not np.isfinite(x).all():
            raise ArgumentError(f"vehicle {self.name!r}: {what} = {x.tolist()}; allowed: {size} finite numbers")
        if not np.array_equal(x[:nq], self.motion.q):  # where it is already, it stays to the last digit
            self.motion.q[:] = with_unit_quaternions(x[:nq], self.quaternions, f"vehicle {self.name!r}: {what}")
        self.motion.v[:] = x[nq:]


class _Vehicles(dict[str, _Vehicle]):
    """Vehicles of a plant by name; ArgumentError for another name."""

    def __missing__(self, name: str) -> _Vehicle:
        raise ArgumentError(f"the plant has no vehicle {name!r}; it has {list(self)}")


class MujocoPlant:
    """Plant of vehicles in a compiled MuJoCo model (``mathnavi.interfaces.protocols.PlantWithActivations``).

    The first keyframe of the model, if it has one, sets controls, activations and mocap bodies at t = 0. MuJoCo's own
    reset of a simulation that diverges is switched off in the model; it is an event of the kind ``DIVERGED`` instead.
    The model must not change from the first step on: steps far from any contact are made with a copy of it.
    """

    def __init__(self, model: mujoco.MjModel, vehicles: Mapping[str, VehicleSetup], rng: np.random.Generator) -> None:
        """Build the plant at t = 0; each sensor draws from its own stream, spawned from ``rng``.

        Raises ValueError if a vehicle is not in the model, its start does not fit its joints, or the period of a sensor
        is not a whole number of ticks.
        """
        if not vehicles:
            raise ArgumentError("a plant needs at least one vehicle")
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.model, self.data = model, mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, self.data, 0)
            self.data.time = 0.0
        self.dt = float(model.opt.timestep)
        self._ticks = 0
        self._before = np.empty(mujoco.mj_stateSize(model, _STATE))
        self._sensors = OwnSensors(model, self.data)
        generators = rng.spawn(len(vehicles))
        self._vehicles = _Vehicles(
            (name, _Vehicle(name, setup, model, self.data, generator, partial(self._sensors.read, name)))
            for (name, setup), generator in zip(vehicles.items(), generators, strict=True)
        )
        self._names = tuple(self._vehicles)
        self._warnings = SimulationWarnings(model, self.data, self._names)
        self._each = tuple(self._vehicles.values())
        self._late = tuple(vehicle for vehicle in self._each if vehicle.delay)
        self._touching = False  # any vehicle anything
        self._read_between: dict[int, tuple[_Vehicle, ...]] = {}
        self._owner = {geom: vehicle for vehicle in self._vehicles.values() for geom in vehicle.geoms}
        self._reports: dict[tuple[int, int], list[tuple[str, str, str]]] = {}  # of two geoms, once they touched
        self._driven = [(vehicle, vehicle.drive) for vehicle in self._vehicles.values() if vehicle.drive is not None]
        self._expected = _expected_contacts(model, self._each)
        sleeping = bool(model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_SLEEP))  # which no state restores
        # nothing acts except held inputs
        self._held = not (self._late or self._driven or self._expected is not None or sleeping)
        mujoco.mj_forward(model, self.data)

    @property
    def t(self) -> float:
        return self._ticks * self.dt

    @property
    def names(self) -> tuple[str, ...]:
        return self._names

    def state(self, name: str) -> Array:
        return self._vehicles[name].motion.x

    def state_names(self, name: str) -> tuple[str, ...]:
        return self._vehicles[name].state_names

    def signal_names(self, name: str) -> SignalNames:
        return self._vehicles[name].signals

    def activation_names(self, name: str) -> tuple[str, ...]:
        return self._vehicles[name].activation_names

    def activations(self, name: str) -> Array:
        values: Array = self.data.act[self._vehicles[name].activations]
        return values

    def sensor_sizes(self, name: str) -> dict[str, int]:
        return {each.sensor.name: each.sensor.size for each in self._vehicles[name].sensors}

    def sensors(self, name: str) -> tuple[Sensor, ...]:
        return tuple(each.sensor for each in self._vehicles[name].sensors)

    def layout(self, name: str) -> Layout:
        """Return the places of a vehicle in the arrays of ``model`` and ``data``."""
        return self._vehicles[name].layout

    def contacts(self, name: str) -> int:
        """Return the number of times that the vehicle has begun to touch something."""
        return self._vehicles[name].contacts

    def sense(self, name: str) -> Sequence[Measurement]:
        vehicle = self._vehicles[name]
        self._read(vehicle, at_control_step=True)
        readings, vehicle.readings = vehicle.readings, []
        return readings

    def _read(self, vehicle: _Vehicle, *, at_control_step: bool) -> None:
        """Read the sensors that are due at this tick."""
        ticks = self._ticks
        for each in vehicle.sensors:
            if each.due(ticks, at_control_step):
                sensor = each.sensor
                value = sensor.read(vehicle.motion, each.rng)
                if value is not None:
                    vehicle.readings.append(Measurement(sensor.name, ticks * self.dt, value))

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        vehicle = self._vehicles[name]
        vehicle.wrench[:3] += force
        if torque is not None:
            vehicle.wrench[3:] += torque
        vehicle.disturbed = True

    def displace(self, name: str, offset: Array) -> None:
        vehicle = self._vehicles[name]
        for i, axis in vehicle.slides:
            vehicle.motion.q[i] += float(axis @ offset)
        self._sensors.passed()

    def place(self, name: str, state: Array) -> None:
        self._vehicles[name].place(state, "state")
        self._sensors.passed()
        mujoco.mj_forward(self.model, self.data)  # sensors then read at the new place
        self._sensors.passed()

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        """Advance by a number of ticks with inputs (nu,) by name and forces held; a vehicle without a command has no
        input.

        An input beyond its bound is clipped to it. That, and every contact, is an event when it begins:
        "input-clipped", "ground-contact", "vehicle-contact", "contact". The first warning of each kind that MuJoCo has
        about the simulation is "physics-warning", or ``DIVERGED`` where its state is lost. With delayed actuators, an
        input acts that number of ticks later; until the first one arrives, none acts.
        """
        events: list[Event] = []
        self._sensors.begin_step()
        for vehicle in self._each:
            command = commands.get(vehicle.name)
            control = np.zeros_like(vehicle.control) if command is None else self._bounded(vehicle, command, events)
            if vehicle.delay:
                vehicle.underway.append((self._ticks + vehicle.delay, control.copy()))
            else:
                vehicle.control[:] = control
        # Samples of one rate are at multiples of its period, so there is little to read in between.
        between = self._between(ticks) if self._ticks % ticks == 0 else self._each
        for vehicle in between:
            vehicle.readings.clear()
        if not (self._held and not between and not self._touching and self._pass_free(ticks)):
            self._pass(ticks, between, events)
        self._sensors.passed()
        self.data.time = self._ticks * self.dt
        self._sensors.end_step()
        for vehicle in self._each:
            if vehicle.disturbed:
                vehicle.wrench[:] = 0.0
                vehicle.disturbed = False
        return events

    def _pass_free(self, ticks: int) -> bool:
        """Advance by a number of ticks with all inputs held, in one call; return False, with nothing changed, if
        anything touches."""
        model, data, free = self.model, self.data, self._contact_free
        mujoco.mj_getState(model, data, self._before, _STATE)
        if free is not None and free.ahead(ticks * self.dt):
            mujoco.mj_step(free.model, data, ticks)
            if free.within(ticks * self.dt):
                self._ticks += ticks
                return True
            mujoco.mj_setState(model, data, self._before, _STATE)
            self._warnings.clear()
        data.maxuse_con = 0
        mujoco.mj_step(model, data, ticks)
        if data.maxuse_con or self._warnings.pending:
            mujoco.mj_setState(model, data, self._before, _STATE)
            self._warnings.clear()
            return False
        self._ticks += ticks
        return True

    @cached_property
    def _contact_free(self) -> ContactFree | None:
        """Return steps without collision detection if nothing moves but one vehicle on slide joints."""
        slides = len(self._each[0].slide_rates) if len(self._each) == 1 else 0
        return ContactFree(self.model, self.data) if ContactFree.applies(self.model, slides) else None

    def _pass(self, ticks: int, between: Sequence[_Vehicle], events: list[Event]) -> None:
        """Advance tick by tick: read the sensors of the vehicles ``between``, note contacts and warnings, apply delayed
        inputs.
        """
        model, data, sensors = self.model, self.data, self._sensors
        for left in range(ticks - 1, -1, -1):
            for vehicle in self._late:
                while vehicle.underway and vehicle.underway[0][0] <= self._ticks:
                    vehicle.control[:] = vehicle.underway.popleft()[1]
            for vehicle, drive in self._driven:
                motion = vehicle.motion
                drive.act(vehicle.control, motion.q, motion.v, vehicle.actuators, self.dt)
            mujoco.mj_step(model, data)
            self._ticks += 1
            sensors.passed()
            if self._warnings.pending:
                events += self._warnings.taken(self.t)
            if self._warnings.lost:
                self._ticks += left  # nothing that the remaining ticks could show
                return
            if (data.ncon and not self._as_expected()) or self._touching:
                self._touch(events)
            if left:
                for vehicle in between:
                    self._read(vehicle, at_control_step=False)

    def _between(self, ticks: int) -> tuple[_Vehicle, ...]:
        """Return the vehicles with sensors to be read within steps of a number of ticks; sense() reads the others."""
        if ticks not in self._read_between:
            self._read_between[ticks] = tuple(v for v in self._each if any(m.every % ticks for m in v.sensors))
        return self._read_between[ticks]

    def _bounded(self, vehicle: _Vehicle, command: Array, events: list[Event]) -> Array:
        """Return the command clipped to its bound."""
        if command.shape != vehicle.control.shape:
            raise ArgumentError(
                f"vehicle {vehicle.name!r}: the command has shape {command.shape}; allowed: {vehicle.control.shape}"
            )
        if not math.isfinite(command.dot(command)):
            raise ArgumentError(
                f"vehicle {vehicle.name!r}: the command {command.tolist()} at {self.t:.3f} s is not finite"
            )
        control, clipped = vehicle.bounded(command)
        if clipped and not vehicle.clipped:
            events.append(Event(self.t, vehicle.name, "input-clipped", clipped))
        vehicle.clipped = bool(clipped)
        return control

    def _as_expected(self) -> bool:
        """Return True if the only contacts are those of vehicles with the geoms whose contacts are ignored."""
        if self._expected is None:
            return False
        pairs = self.data.contact.geom
        return bool(self._expected[pairs[:, 0], pairs[:, 1]].all())

    def _reported(self, first: int, second: int) -> list[tuple[str, str, str]]:
        """Return vehicles that touch something where two geoms do, what they touch, and the kind of the event."""
        if (found := self._reports.get((first, second))) is not None:
            return found
        found = self._reports[first, second] = []
        for own, other in ((first, second), (second, first)):
            owner, stranger = self._owner.get(own), self._owner.get(other)
            if owner is None or owner is stranger or self.model.geom(other).name in owner.ignored_contacts:
                continue
            if stranger is not None:
                found.append((owner.name, stranger.name, "vehicle-contact"))
            else:
                ground = int(self.model.geom_type[other]) in _GROUND
                thing = thing_named(self.model.geom(other).name, other)
                found.append((owner.name, thing, "ground-contact" if ground else "contact"))
        return found

    def _touch(self, events: list[Event]) -> None:
        """Return the contacts that began with this tick."""
        touched: dict[str, dict[str, str]] = {name: {} for name in self._names}  # vehicle -> what it touches -> kind
        for first, second in self.data.contact.geom.tolist():
            for name, thing, kind in self._reported(first, second):
                touched[name][thing] = kind
        for vehicle in self._each:
            now = touched[vehicle.name]
            for thing in sorted(now.keys() - vehicle.touched):
                slides = [i for i, _ in vehicle.slides]  # revolute joints do not contribute to its position
                where = np.round(vehicle.motion.q[slides], 1).tolist()
                speed = float(np.linalg.norm(vehicle.motion.v[vehicle.slide_rates]))
                events.append(Event(self.t, vehicle.name, now[thing], touching(thing, where, speed)))
                vehicle.contacts += 1
            vehicle.touched = frozenset(now)
        self._touching = any(touched.values())


def _expected_contacts(model: mujoco.MjModel, vehicles: Iterable[_Vehicle]) -> NDArray[np.bool_] | None:
    """Return an array (ngeom, ngeom), True for pairs of geoms whose contacts are ignored; None without such pairs."""
    expected = np.zeros((model.ngeom, model.ngeom), dtype=bool)
    for vehicle in vehicles:
        own = sorted(vehicle.geoms)
        for name in vehicle.ignored_contacts:
            ground = _geom(model, vehicle, name)
            expected[own, ground] = expected[ground, own] = True
    return expected if expected.any() else None


def _geom(model: mujoco.MjModel, vehicle: _Vehicle, name: str) -> int:
    """Index of the geom; ArgumentError, which lists those of the model outside the vehicle, if none exists."""
    known = {model.geom(i).name: i for i in range(model.ngeom)}
    if name and name in known:
        return known[name]
    others = [each for each, i in known.items() if each and i not in vehicle.geoms]
    raise ArgumentError(f"vehicle {vehicle.name!r}: ignored_contacts: no geom {name!r}; {allowed_for(name, others)}")


def _slice(indices: Sequence[int], first: int, end: int) -> slice:
    """Return a slice for a view into MuJoCo's arrays; ArgumentError if the indices are not adjacent."""
    if list(indices) != list(range(indices[0], indices[-1] + 1)):
        raise ArgumentError(f"the joints or actuators of a vehicle are not adjacent in the model: {list(indices)}")
    return slice(first, end)
