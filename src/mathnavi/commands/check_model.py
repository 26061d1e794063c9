"""Check of an MJCF file: MuJoCo compiles it, and it is stepped for five seconds as it stands.

A file whose joints have names "VEHICLE/JOINT" is the world of a scenario of yours; the vehicles in it are put into
the plant of such a scenario. Any other file is a mechanism, put into ``arm-velocity`` with each of the controllers and
estimators that drive and observe mechanisms.
"""

from __future__ import annotations

import copy
import os
import re
import shlex
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mathnavi.commands.check_findings import CheckResult, split_joined
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.model_signals import input_names, reading_unit
from mathnavi.interfaces.reading.mechanisms import read_spec
from mathnavi.interfaces.short_tables import counted
from mathnavi.interfaces.signals import DIVERGED, Event
from mathnavi.models.mechanism.entity import build_model, file_of
from mathnavi.sim.engine.contact_messages import KINDS, declaration, thing_touched
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller, checked_estimator, load
from mathnavi.sim.scenarios.arm_velocity import VEHICLE, ArmVelocityConfig, believed, clock

DURATION = 5.0  # [s] of the run that is proposed
TIME_STEPPED = 5.0  # [s] for which a model is stepped
AT_REST = 0.5  # [s] within which what touches stands there
CONTROLLERS = ("joint_tracking", "input_signal")  # of mechanisms, the scenario's own first
ESTIMATORS = (
    *("riemannian_observer", "lagrangian_ekf", "momentum_observer", "high_gain", "filtered_differences"),
    *("floating_base_iekf", "full_state"),
)
_HALVINGS = 5  # of a timestep that is too long
_TICKS = 10  # steps at once
_READING = 'MujocoSensor.of(model, "{vehicle}", "{name}", rate=HZ)'


def check_model(place: str) -> CheckResult:
    """Check an MJCF file, or a mechanism by its name. Raises FieldError if there is no such file."""
    path = file_of(place)
    result = CheckResult(place)
    model = _compiled(path, result)
    if model is None:
        return result
    vehicles = _vehicles(model)
    result.fact(
        "MuJoCo",
        [
            f"compiles it: {model.nbody - 1} bodies, {model.njnt} joints, {model.nactuator} actuators, "
            f"{model.nsensor} sensors; timestep {model.opt.timestep:g} s"
        ],
    )
    if vehicles:
        _check_vehicles(model, vehicles, result)
    else:
        _check_mechanism(place, model, result)
    return result


def _compiled(path: Path, result: CheckResult) -> mujoco.MjModel | None:
    """Compile a file as MuJoCo does; what it says where it cannot is a finding, and what it warns of a note."""
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            spec = read_spec(path, FieldError)
            model = spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        what = " ".join(str(error).split()).removeprefix(f"{path}: ")
        unread = re.fullmatch(r"MuJoCo cannot read it \((.*?) ?\)", what)
        if unread is not None and "could not find decoder" in unread[1]:
            raise FieldError(f"{path} is no model; allowed: an MJCF file, .xml, or a plug-in, MODULE:Class") from None
        if isinstance(error, FieldError) and unread is None:
            result.refused(what)
        else:
            relative = os.path.relpath(path)
            shown = str(path) if relative.startswith(os.pardir) else relative
            result.refused_by_mujoco(unread[1] if unread else what, shown)
        return None
    for each in warned:
        result.note(f"MuJoCo warns: {' '.join(str(each.message).split())}", "")
    return model


def _vehicles(model: mujoco.MjModel) -> list[str]:
    """Return the vehicles of a model: what stands before "/" in the names of its joints."""
    names = (model.joint(j).name.partition("/") for j in range(model.njnt))
    return list(dict.fromkeys(vehicle for vehicle, slash, _ in names if slash))


# ---- vehicles in the world of a scenario of yours


def _check_vehicles(model: mujoco.MjModel, vehicles: Sequence[str], result: CheckResult) -> None:
    _check_names(model, vehicles, result)
    try:
        plant = MujocoPlant(copy.copy(model), _setups(model, vehicles), np.random.default_rng(0))
    except ValueError as error:
        result.refused(" ".join(str(error).split()))
        return
    for vehicle in vehicles:
        begin = f"{vehicle}/"
        states = plant.state_names(vehicle)
        result.fact(f"{vehicle}: state", [f"{len(states)}: {split_joined(states)}"])
        inputs = [_input(model, i) for i in range(model.nactuator) if model.actuator(i).name.startswith(begin)]
        result.fact(f"{vehicle}: input", [f"{len(inputs)}: {split_joined(inputs)}" if inputs else "none: it coasts"])
        own = [i for i in range(model.nsensor) if model.sensor(i).name.startswith(begin)]
        lines = [_sensor(model, i, _READING.format(vehicle=vehicle, name=_short(model, i))) for i in own]
        result.fact(f"{vehicle}: sensors", lines or ["none"])
    _check_motion(plant, result)


def _setups(model: mujoco.MjModel, vehicles: Sequence[str]) -> dict[str, VehicleSetup]:
    """Start of each vehicle at the first keyframe, or at qpos0 at rest."""
    q = model.key_qpos[0] if model.nkey else model.qpos0
    v = model.key_qvel[0] if model.nkey else np.zeros(model.nv)
    setups = {}
    for vehicle in vehicles:
        joints = [j for j in range(model.njnt) if model.joint(j).name.startswith(f"{vehicle}/")]
        places = [np.atleast_1d(q[_span(model.jnt_qposadr, model.nq, j)]) for j in joints]
        rates = [np.atleast_1d(v[_span(model.jnt_dofadr, model.nv, j)]) for j in joints]
        setups[vehicle] = VehicleSetup(np.concatenate([*places, *rates]))
    return setups


def _span(first: Any, size: int, j: int) -> slice:
    """Places of a joint in qpos or qvel: from its first one to that of the next joint."""
    return slice(int(first[j]), int(first[j + 1]) if j + 1 < len(first) else size)


def _check_names(model: mujoco.MjModel, vehicles: Sequence[str], result: CheckResult) -> None:
    """Find what moves with a vehicle, or acts on it, and lacks its name."""
    owner = {0: ""}
    for b in range(1, model.nbody):
        name, parent = model.body(b).name, owner[int(model.body_parentid[b])]
        owner[b] = next((vehicle for vehicle in vehicles if name.startswith(f"{vehicle}/")), parent)
        if owner[b] and not name.startswith(f"{owner[b]}/") and model.body_geomnum[b]:
            result.missing(
                f"body {name or b!r} moves with {owner[b]} and lacks its name: whatever touches it is a contact of a "
                f"stranger, also {owner[b]} itself",
                f'<body name="{owner[b]}/{name or "NAME"}" ...>',
            )
    joints = {j: owner[int(model.jnt_bodyid[j])] for j in range(model.njnt)}
    for j, vehicle in joints.items():
        name = model.joint(j).name
        if vehicle and not name.startswith(f"{vehicle}/"):
            result.missing(
                f"joint {name or j!r} of {vehicle} lacks its name: it is no state", f'name="{vehicle}/{name or "NAME"}"'
            )
    for i in range(model.nactuator):
        name, on = model.actuator(i).name, _moved(model, i, joints, owner)
        if on and not name.startswith(f"{on}/"):
            result.missing(
                f"actuator {name or i!r} acts on {on} and lacks its name: it is no input, and stays at 0",
                f'name="{on}/{name or "NAME"}"',
            )
    for i in range(model.nsensor):
        name = model.sensor(i).name
        if not name.startswith(tuple(f"{vehicle}/" for vehicle in vehicles)):
            one = vehicles[0] if len(vehicles) == 1 else "VEHICLE"
            result.note(
                f"the sensor {name or i!r} ({_kind(model, i)}) belongs to no vehicle, and is not read",
                f'name="{one}/{name or "NAME"}"',
            )


def _moved(model: mujoco.MjModel, i: int, joints: Mapping[int, str], owner: Mapping[int, str]) -> str:
    """Vehicle that an actuator on a joint, a site or a body acts on; "" for another transmission."""
    kind, target = mujoco.mjtTrn(int(model.actuator_trntype[i])), int(model.actuator_trnid[i, 0])
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        return joints[target]
    if kind == mujoco.mjtTrn.mjTRN_SITE:
        return owner[int(model.site_bodyid[target])]
    return owner[target] if kind == mujoco.mjtTrn.mjTRN_BODY else ""


def _input(model: mujoco.MjModel, i: int) -> str:
    name = ", ".join(each.removesuffix(" [-]") for each in input_names(model, i))
    low, high = model.actuator_ctrlrange[i]
    return f"{name} from {low:g} to {high:g}" if model.actuator_ctrllimited[i] else f"{name} without a bound"


# ---- a mechanism


def _check_mechanism(place: str, model: mujoco.MjModel, result: CheckResult) -> None:
    try:
        config = ArmVelocityConfig(mechanism=place, duration=DURATION)
        mission = believed(config)
        arena = build_model(place, name=VEHICLE)
    except (ValueError, RuntimeError) as error:
        result.refused(" ".join(str(error).split()).removeprefix(f"mechanism = {place!r}: "))
        return
    arena.opt.timestep, _ = clock(arena.opt.timestep, config.rate)
    result.fact("state", [f"{len(mission.system.states)}: {split_joined(mission.system.states)}"])
    result.fact("input", [f"{len(mission.system.inputs)}: {split_joined(mission.system.inputs)}"])
    own = split_joined([f"{model.sensor(i).name or i} {_kind(model, i)}" for i in range(model.nsensor)])
    unread = f"; its own, {own}, are read in a scenario of yours, and an IMU by floating_base_iekf" if own else ""
    result.fact("sensors", [f"arm-velocity reads the position of every joint{unread}"])
    chosen = {
        "controller": _first_that_fits("controllers", CONTROLLERS, partial(_controller, mission), result),
        "estimator": _first_that_fits("estimators", ESTIMATORS, partial(_estimator, mission), result),
    }
    plant = MujocoPlant(arena, _setups(arena, [VEHICLE]), np.random.default_rng(0))
    _check_motion(plant, result, np.array(mission.system.constant))
    if result.fits and all(chosen.values()):
        defaults = {"controller": CONTROLLERS[0], "estimator": ESTIMATORS[0]}
        flags = [f"--{part} {name}" for part, name in chosen.items() if name != defaults[part]]
        words = ["mathnavi run arm-velocity --mechanism", shlex.quote(place), *flags, f"--duration {DURATION:g}"]
        result.command = " ".join(words)


def _controller(mission: Any, spec: PluginSpec) -> object:
    return checked_controller(spec, mission)


def _estimator(mission: Any, spec: PluginSpec) -> object:
    return checked_estimator(spec, mission)


def _first_that_fits(kind: str, names: Sequence[str], build: Callable[[PluginSpec], Any], result: CheckResult) -> str:
    """Return the first of the plug-ins that can be built for the mission; those that cannot are notes, or, if none can,
    missing."""
    fitting, refusals = [], {}
    for name in names:
        try:
            build(PluginSpec.with_fields(load(kind, name)))
            fitting.append(name)
        except (ValueError, RuntimeError) as error:
            refusals[name] = " ".join(str(error).split())
    result.fact(f"{kind} that fit", [", ".join(fitting) or "none"])
    if not fitting:
        result.refused(refusals[names[0]])
    elif names[0] in refusals:
        what = refusals[names[0]].partition("; allowed: ")[0]
        result.note(f"{names[0]}, which is the default, does not fit: {what}", f"--{kind[:-1]} {fitting[0]}")
    return fitting[0] if fitting else ""


# ---- of both


def _check_motion(plant: MujocoPlant, result: CheckResult, u: Any = None) -> None:
    """Step the plant for five seconds, without commands, or that of a mechanism with ``u`` held."""
    model, commands = copy.copy(plant.model), {} if u is None else {VEHICLE: u}
    events = _stepped(plant, commands)
    for event in events:
        if event.kind == DIVERGED:
            result.missing(f"at {event.t:.3g} s {event.message}", _finer(model, plant.names, commands))
        elif event.kind == "physics-warning":
            result.note(f"MuJoCo warns at {event.t:.3g} s: {event.message}", "")
    for vehicle in plant.names:
        at_rest = [event for event in events if event.agent == vehicle and event.t <= AT_REST and event.kind in KINDS]
        things = sorted({thing_touched(event) for event in at_rest})
        if things and u is None:
            result.note(f"{vehicle} touches {split_joined(things)} at rest, which is an event", declaration(things))
        else:
            heading = "at rest" if u is not None else f"{vehicle}: at rest"
            result.fact(heading, [f"touches {split_joined(things) or 'nothing'}"])


def _stepped(plant: MujocoPlant, commands: Mapping[str, Any]) -> list[Event]:
    """Events of five seconds, or of the time until the simulation diverges."""
    events: list[Event] = []
    printing = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)  # events say each warning once
    try:
        for _ in range(0, round(TIME_STEPPED / plant.dt), _TICKS):
            events += plant.step(commands, _TICKS)
            if any(event.kind == DIVERGED for event in events):
                break
    finally:
        mujoco.set_mju_user_warning(printing)
    return events


def _finer(model: mujoco.MjModel, vehicles: Sequence[str], commands: Mapping[str, Any]) -> str:
    """Return the longest timestep, by halves, with which the simulation does not diverge, as the line to write."""
    finer = copy.copy(model)
    for _ in range(_HALVINGS):
        finer.opt.timestep = float(finer.opt.timestep) / 2.0
        plant = MujocoPlant(copy.copy(finer), _setups(finer, vehicles), np.random.default_rng(0))
        if not any(event.kind == DIVERGED for event in _stepped(plant, commands)):
            return f'<option timestep="{finer.opt.timestep:g}"/>'
    return f"another model: at a timestep of {finer.opt.timestep:g} s it diverges as well"


def _kind(model: mujoco.MjModel, i: int) -> str:
    return f"<{mujoco.mjtSensor(int(model.sensor_type[i])).name.removeprefix('mjSENS_').lower()}>"


def _short(model: mujoco.MjModel, i: int) -> str:
    return str(model.sensor(i).name.partition("/")[2])


def _sensor(model: mujoco.MjModel, i: int, reading: str) -> str:
    noise, unit = float(model.sensor_noise[i]), reading_unit(model, i)
    what = f"{_kind(model, i)}, {counted(int(model.sensor_dim[i]), 'number')}{f' [{unit}]' if unit else ''}"
    return f"{_short(model, i)}: {what}, {f'noise {noise:g}' if noise else 'exact'}, read by {reading}"
