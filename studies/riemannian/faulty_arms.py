"""Observers of arms and hands whose gains, damping and load are not those that every estimator believes.

A robot is moved by a sine on every actuator and read by encoders of 14 bits at each timestep of its file. Its servos
have a stiffness (motors: a gain) that is 20 % off, its joints twice the damping, its last link half as much again of
mass and inertia, its encoders are not declared, or all of this together. Rivals are tuned by a sweep on another run,
without a fault.

**Sure and wrong** is an estimate that is OK while some velocity is off by more than three of its declared deviations
for longer than 0.25 s; errors below a thousandth of the greatest speed do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.manifold.mission import POSITION, LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model, file_of
from mathnavi.models.mechanism.system import MechanismSystem, heavier
from mathnavi.sim.metrics.sure_and_wrong import lasting
from mathnavi.sim.metrics.tuning import RecordedCall, spread, tuned
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.framework.study import Row
from mathnavi.studies.riemannian.mechanisms import BITS, BUTTERWORTH, EKF, MOMENTUM, OBSERVER, SWEPT

TUNED_AT, SHOWN_AT = 2.5, 3.0  # [rad/s] of the first actuator; each further one is faster by a twelfth
SETTLED = 1.0  # [s] from when on errors count
SHARE, LARGEST = 0.2, 0.4  # of half an actuator's range, and [rad, m] at most, of a servo's sine
LASTING, DEVIATIONS = 0.25, 3.0  # [s]
NOTHING = 1e-3  # of the greatest speed
SMALL = 9  # joints, up to which the Kalman filter, whose cost grows with their square, is a rival
RIVALS = (BUTTERWORTH, MOMENTUM, EKF)
ROBOTS = (
    "servo-six", "servo-seven", "servo-gripper", "dm_control:manipulator", "dm_control:reacher", "dm_control:finger",
    *(f"menagerie:{name}" for name in (
        "universal_robots_ur5e", "robotiq_2f85", "kuka_iiwa_14", "franka_emika_panda", "franka_fr3", "ufactory_xarm7",
        "ufactory_lite6", "kinova_gen3", "unitree_z1", "trossen_vx300s", "agilex_piper", "trs_so_arm100", "leap_hand",
        "wonik_allegro",
    )),
)  # fmt: skip
"""six mechanisms that are at hand, and fourteen robots of MuJoCo Menagerie, which are fetched"""


@dataclass(frozen=True)
class Fault:
    """Difference between the true model and the assumed one."""

    name: str
    gain: float = 1.0  # times the stiffness of servos, and the gain of motors
    damping: float = 1.0  # times that of joints
    load: float = 1.0  # times the mass and inertia of the last link
    declared: bool = True  # whether the encoders are

    def true(self, model: mujoco.MjModel) -> mujoco.MjModel:
        """Return the true model."""
        other = heavier(model, self.load)
        other.actuator_gainprm[:, 0] *= self.gain
        other.actuator_biasprm[:, 1] *= self.gain
        other.dof_damping[:] *= self.damping
        return other


NONE = Fault("as declared")
FAULTS = (
    NONE,
    Fault("gains x 0.8", gain=0.8),
    Fault("gains x 1.2", gain=1.2),
    Fault("encoders not declared", declared=False),
    Fault("damping x 2", damping=2.0),
    Fault("load x 1.5", load=1.5),
    Fault("all together", 0.8, 2.0, 1.5, False),
)


def at_hand(robots: Sequence[str]) -> list[str]:
    """Return the robots whose files are here, or can be fetched."""
    found = []
    for robot in robots:
        try:
            file_of(robot)
        except FieldError:
            continue
        found.append(robot)
    return found


def moved(
    robot: str, fault: Fault, frequency: float, seconds: float, seed: int
) -> tuple[LagrangianMission, list[RecordedCall]]:
    """The mission that is believed, and the calls of an estimator, of a robot with a fault."""
    model = _built(robot)
    true, rng = fault.true(model), np.random.default_rng(seed)
    data = mujoco.MjData(true)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(true, data, 0)
    system = MechanismSystem(model)
    manifold, h = system.manifold, float(model.opt.timestep)
    mission = LagrangianMission(system, PositionQuality(resolution=BITS if fault.declared else 0), h)
    middle, amplitude, ends = data.ctrl.copy(), _amplitude(model), _ends(model)
    rates = frequency * (1.0 + np.arange(model.nu) / 12.0)
    phases = rng.uniform(-np.pi, np.pi, model.nu)
    calls, u = [], middle
    for k in range(round(seconds / h) + 1):
        y = manifold.rounded(data.qpos.copy(), BITS)
        calls.append(RecordedCall(k * h, (Measurement(POSITION, k * h, y),), u, np.append(data.qpos, data.qvel)))
        u = np.clip(middle + amplitude * (np.sin(rates * k * h + phases) - np.sin(phases)), *ends)
        data.ctrl[:] = u
        mujoco.mj_step(true, data)
    return mission, calls


@cache
def _built(robot: str) -> mujoco.MjModel:
    return build_model(robot)


def _ends(model: mujoco.MjModel) -> Array:
    ends: Array = np.where(model.actuator_ctrllimited[:, np.newaxis], model.actuator_ctrlrange, (-np.inf, np.inf)).T
    return ends


def _amplitude(model: mujoco.MjModel) -> Array:
    """Amplitudes (nu,) of the sines."""
    half = 0.5 * np.diff(model.actuator_ctrlrange)[:, 0]
    on_joint = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
    servo = (model.actuator_biastype != int(mujoco.mjtBias.mjBIAS_NONE)) & on_joint
    share = np.where(model.actuator_ctrllimited != 0, SHARE * half, LARGEST)
    amplitude: Array = np.where(servo, np.minimum(share, LARGEST), share)
    return amplitude


def compared(robot: str, seconds: float, values: int, faults: int) -> list[dict[str, Any]]:
    """A job: rows of the observer and its rivals on one robot, with each of the first ``faults``.

    ``error`` [rad/s, m/s] is the root mean square of |qvel^ - qvel| from ``SETTLED`` on while an estimator is not lost;
    ``ok``, ``lost`` and ``wrong`` are shares of that time: OK, LOST, and sure and wrong; ``worst`` is the largest error
    while OK and ``peak`` the greatest speed [rad/s, m/s]; ``raised`` an exception.
    """
    rows: list[dict[str, Any]] = []
    try:
        mission, before = moved(robot, NONE, TUNED_AT, seconds, 1)
        joints = mission.system.manifold.dimension
        rates = slice(mission.system.manifold.size, None)
        settings: dict[str, tuple[Any, Any, float]] = {}
        observer = load("estimators", "riemannian_observer")
        settings[OBSERVER] = observer, observer.Config(), np.nan
        for name in RIVALS if joints <= SMALL else RIVALS[:2]:
            called, field, grid = SWEPT[name]
            plugin = load("estimators", called)
            swept = _allowed(name, mission, spread(grid, values))
            found = tuned(plugin, plugin.Config(), mission, before, field, swept, rates, SETTLED)
            settings[name] = plugin, replace(plugin.Config(), **{field: found.best}), found.best
    except (ValueError, ArithmeticError, np.linalg.LinAlgError, mujoco.FatalError) as error:
        return [_raised(robot, FAULTS[0].name, OBSERVER, error)]
    for fault in FAULTS[:faults]:
        mission, calls = moved(robot, fault, SHOWN_AT, seconds, 2)
        for name, (plugin, config, setting) in settings.items():
            try:
                row = _judged(plugin.build(config, mission), calls, mission)
            except (ValueError, ArithmeticError, np.linalg.LinAlgError, mujoco.FatalError) as error:
                rows.append(_raised(robot, fault.name, name, error))
                continue
            rows.append(
                {"robot": robot, "fault": fault.name, "estimator": name, "setting": setting, **row, "raised": ""}
            )
    return rows


def _allowed(name: str, mission: LagrangianMission, values: Sequence[float]) -> Sequence[float]:
    """The values of a sweep that are allowed at the rate of the readings."""
    return [each for each in values if name != BUTTERWORTH or each < 0.5 / mission.period]


def _raised(robot: str, fault: str, estimator: str, error: Exception) -> dict[str, Any]:
    nothing = {"error": np.inf, **dict.fromkeys(("ok", "lost", "wrong", "worst", "peak"), np.nan)}
    row = {"robot": robot, "fault": fault, "estimator": estimator, "setting": np.nan, **nothing}
    return {**row, "raised": f"{type(error).__name__}: {error}"}


def _judged(estimator: Any, calls: Sequence[RecordedCall], mission: LagrangianMission) -> dict[str, float]:
    size = mission.system.manifold.size
    truth = np.array([call.truth[size:] for call in calls])
    found = [estimator.update(call.t, call.measurements, call.command) for call in calls]
    error = np.array([each.x[size:] for each in found]) - truth
    deviation = np.array([each.extra["deviation"][-truth.shape[1] :] for each in found])
    statuses = [each.status for each in found]
    ok, lost = (np.array([each is word for each in statuses]) for word in (Status.OK, Status.LOST))
    t = np.array([call.t for call in calls])
    late = t >= SETTLED
    peak = float(np.linalg.norm(truth, axis=1).max())
    off = np.abs(error) > np.maximum(DEVIATIONS * deviation, NOTHING * peak)
    length = np.linalg.norm(error, axis=1)
    usable, sure = late & ~lost, late & ok
    return {
        "error": float(np.sqrt(np.mean(np.square(length[usable])))) if usable.any() else np.inf,
        "ok": float(ok[late].mean()),
        "lost": float(lost[late].mean()),
        "wrong": float(lasting(t[late], (off.any(axis=1) & ok)[late], LASTING).mean()),
        "worst": float(length[sure].max()) if sure.any() else 0.0,
        "peak": peak,
    }


def by_case(rows: Sequence[Row]) -> dict[tuple[str, str], dict[str, Row]]:
    """Rows by robot and fault, then estimator."""
    found: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        found.setdefault((row["robot"], row["fault"]), {})[row["estimator"]] = row
    return found
