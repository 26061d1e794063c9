"""Arms whose gains, damping, friction or load are not those of their files, and what observers make of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem, heavier
from mathnavi.sim.plugin.registry import load

BITS = 14
LASTING = 0.25  # [s] for which an estimate is wrong before it counts


def faulty(
    model: mujoco.MjModel, gain: float = 1.0, friction: float = 0.0, load: float = 1.0, damping: float = 1.0
) -> mujoco.MjModel:
    """The model with the position gains (or those of motors) times ``gain``, more friction [N m], a load, and the
    damping times ``damping``.
    """
    other = heavier(model, load)
    other.actuator_gainprm[:, 0] *= gain
    other.actuator_biasprm[:, 1] *= gain
    other.dof_frictionloss[:] += friction
    other.dof_damping[:] *= damping
    return other


@cache
def moved(arm: str, seconds: float = 1.5, **fault: float) -> tuple[mujoco.MjModel, Array, Array, Array]:
    """The believed model, and positions (N, nq), velocities (N, nv) and controls (N, nu) until them."""
    model = build_model(arm)
    true = faulty(model, **fault)
    data = mujoco.MjData(true)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(true, data, 0)
    middle, servo = data.ctrl.copy(), (model.actuator_biastype != 0).any()
    rates = 3.0 + 0.5 * np.arange(model.nu)
    rows = [(data.qpos.copy(), data.qvel.copy(), middle)]
    for k in range(round(seconds / model.opt.timestep)):
        data.ctrl[:] = middle + (0.4 if servo else 1.0) * np.sin(rates * k * model.opt.timestep)
        mujoco.mj_step(true, data)
        rows.append((data.qpos.copy(), data.qvel.copy(), data.ctrl.copy()))
    q, v, u = (np.array(each) for each in zip(*rows, strict=True))
    return model, q, v, u


def observed(
    arm: str,
    method: str,
    seconds: float = 1.5,
    noise: float = 0.0,
    fields: Mapping[str, float] | None = None,
    **fault: float,
) -> Watched:
    """What an observer with these fields, of the believed model, makes of encoders of 14 bits, or of readings with
    noise.
    """
    model, q, v, u = moved(arm, seconds, **fault)
    system, rng = MechanismSystem(model), np.random.default_rng(5)
    quality = PositionQuality(noise=noise) if noise else PositionQuality(resolution=BITS)
    y = q + noise * rng.standard_normal(q.shape) if noise else [system.manifold.rounded(each, BITS) for each in q]
    mission = LagrangianMission(system, quality, float(model.opt.timestep))
    plugin: Any = load("estimators", method)
    estimator = plugin.build(plugin.Config(**(fields or {})), mission)
    times = mission.period * np.arange(len(q))
    found = [estimator.update(t, [Measurement("position", t, a)], b) for t, a, b in zip(times, y, u, strict=True)]
    return Watched(found, v, mission.period)


class Watched:
    """Estimates of a run beside its true velocities (N, nv)."""

    def __init__(self, found: list[Estimate], v: Array, period: float) -> None:
        self.found, self.period = found, period
        self.error = np.array([each.x[-v.shape[1] :] for each in found]) - v
        self.deviation = np.array([each.extra["deviation"][-v.shape[1] :] for each in found])
        self.ok = np.array([each.status is Status.OK for each in found])

    def rms(self, begin: float) -> float:
        """Root mean square error [rad/s] from ``begin`` [s] on."""
        return float(np.sqrt(np.mean(np.square(self.error[round(begin / self.period) :]))))

    @property
    def sure_and_wrong(self) -> bool:
        """True if it is OK and off by more than three of its deviations for longer than ``LASTING``."""
        wrong = self.ok & (np.abs(self.error) > 3.0 * self.deviation).any(axis=1)
        longest = run = 0
        for each in wrong:
            run = run + 1 if each else 0
            longest = max(longest, run)
        return longest * self.period > LASTING
