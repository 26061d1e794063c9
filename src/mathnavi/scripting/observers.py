"""Observers of velocities on your own data, sample by sample: without plug-in and scenario.

A system x' = v, D_t v = F(x, v, u) on a configuration manifold, its metric the kinetic energy, is observed from its
positions x and its inputs u (thesis, Paper D; ``mathnavi.estimators.riemannian``, ``mathnavi.estimators.velocity``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mathnavi.estimators.plausibility.checks import FirstReadings
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.failures import raising
from mathnavi.interfaces.fields import configured
from mathnavi.interfaces.joint_states import QuaternionOrder, check_quaternion_order, scalar_first
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.short_tables import Row, html_table, short_table
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status, status_text
from mathnavi.models.manifold.constant_curvature import ConstantCurvature
from mathnavi.models.manifold.manifold import quaternion_parts
from mathnavi.models.manifold.mission import POSITION, LagrangianMission, PositionQuality
from mathnavi.models.manifold.system import LagrangianSystem
from mathnavi.models.manifold.systems import PointSystem
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import PluginSpec, checked_estimator, load

ANY_SPEED = 1e3  # [rad/s, m/s] 160 turns in a second, three times the speed of sound
_CLOCK = 1e-3  # [s] the nominal period of a mission; the observers follow the steps that they are given


@dataclass(frozen=True, eq=False, repr=False)
class MotionEstimate:
    """Estimate of the state of a Lagrangian system."""

    estimate: Estimate
    position: Array  # (size,) a point of the manifold
    velocity: Array  # (vector_size,) a tangent vector there
    names: tuple[str, ...]  # of the components of both, with units

    @property
    def t(self) -> float:
        """Time [s] since the first step."""
        return self.estimate.t

    @property
    def status(self) -> Status:
        """Status: OK, INITIALISING, DEGRADED or LOST; see ``Status``."""
        return self.estimate.status

    @property
    def covariance(self) -> Array | None:
        """Covariance of the state, if the observer has one."""
        return self.estimate.covariance

    def _table(self) -> tuple[str, list[Row]]:
        return f"estimate at {self.t:.6g} s: {status_text(self.estimate)}", [
            (name.partition(" [")[0], f"{value:.4g}", name.partition(" [")[2].removesuffix("]"))
            for name, value in zip(self.names, self.estimate.x, strict=True)
        ]

    def __repr__(self) -> str:
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        return html_table(*self._table())


class LagrangianObserver:
    """Estimator of a Lagrangian system, stepped through positions and inputs."""

    def __init__(
        self,
        system: LagrangianSystem,
        method: str,
        noise: float,
        speed_max: float,
        quaternions: QuaternionOrder,
        trust_units: bool,
        fields: Any,
    ) -> None:
        check_quaternion_order(quaternions)
        with raising(FieldError):
            mission = LagrangianMission(system, PositionQuality(noise=noise), _CLOCK, speed_max)
            found = load("estimators", method)
            spec = PluginSpec(found, configured(found.Config(), fields))
            self._estimator: Estimator = checked_estimator(spec, mission)
        self._system, self._method, self._t = system, method, 0.0
        self._quaternions = quaternions
        self._first_readings = None if trust_units else FirstReadings(mission, quaternions)

    @property
    def system(self) -> LagrangianSystem:
        """Observed system, with the names and units of its states and inputs."""
        return self._system

    def step(self, dt: float, y: ArrayLike | None, u: ArrayLike | None = None) -> MotionEstimate:
        """Return the estimate at the end of a step of dt [s], over which the input u (nu,) was held.

        y (size,) is the position read at its end, None if the reading was lost. The first step starts the observer at
        its reading, with zero velocity. u is zero if not given.

        Once the first readings have shown that they fit the system only in another unit, with another sign or with the
        scalar of their quaternions last, every estimate is LOST, and its message says so. A y that is not finite, or
        not a point of the manifold, is a reading that was lost.

        Raises FieldError for a dt that is negative, and for y or u of another shape.
        """
        system, n = self._system, len(self._system.inputs)
        if not (np.isfinite(dt) and dt >= 0.0):
            raise FieldError(f"dt = {dt!r}; allowed: a finite number >= 0 [s]")
        command = np.zeros(n) if u is None else np.array(u, dtype=np.float64)
        if command.shape != (n,) or not np.isfinite(command).all():
            raise FieldError(f"u = {command.tolist()}; allowed: {n} finite numbers, of {', '.join(system.inputs)}")
        self._t += float(dt)
        readings, point = [], np.full(system.manifold.size, np.nan)
        if y is not None:
            point = np.array(y, dtype=np.float64)  # a copy: it may be a view of an array that changes
            if point.shape != (system.manifold.size,):
                name, size = system.manifold.name, system.manifold.size
                raise FieldError(f"y has shape {point.shape}; allowed on {name}: ({size},)")
            point = scalar_first(point, quaternion_parts(system.manifold), self._quaternions)
            readings.append(Measurement(POSITION, self._t, point))
        estimate = self._estimator.update(self._t, readings, command)
        if self._first_readings is not None:
            estimate = self._first_readings.judged(estimate, self._t, {POSITION: point}, command)
        size = system.manifold.size
        return MotionEstimate(estimate, estimate.x[:size], estimate.x[size:], tuple(system.states))

    def __repr__(self) -> str:
        return short_table(
            f"{self._method} on {self._system.manifold.name}",
            [("positions", str(self._system.manifold.size), ""), ("inputs", str(len(self._system.inputs)), "")],
        )


class IntrinsicObserver(LagrangianObserver):
    """Observer (D.6) on a manifold, free of coordinates:

        xi' = eta - A grad S,   D_t eta = -B grad S + PT F + C R(eta, grad S) eta,   S = dist(x, xi)^2 / 2.

    ``where`` is ``Sphere(n)``, ``HyperbolicSpace(n)`` or ``EuclideanSpace(n)``, with ``potential`` U(p) [1/s^2], a
    CasADi expression of the ambient point p (size,); or your own system, for example ``RigidBody(inertia)``. Points
    and vectors are ambient: on ``Sphere(3)`` unit vectors (4,). The input is the force, ambient too.

    ``bandwidth`` [1/s] is omega of the gains A = 2 zeta omega, B = omega^2; ``fields`` are the other fields of the
    plug-in ``riemannian_observer``. ``noise`` [rad, m] is the standard deviation of a reading; 0 declares none: noise
    and steps of encoders are found from the readings, and until then estimates are DEGRADED. ``speed_max`` is the
    greatest rate of a joint or a body [rad/s, m/s]: readings that imply twice that are outliers, an estimate so fast is
    LOST. The default is one that only outliers reach. ``quaternions`` is the order of those in y, and
    ``trust_units`` says that they are right where they fit the system in another unit or with another sign only.

    Raises FieldError for a field or a value that is not allowed.
    """

    def __init__(
        self,
        where: ConstantCurvature | LagrangianSystem,
        *,
        bandwidth: float = 10.0,
        potential: Callable[[casadi.SX], casadi.SX] | None = None,
        noise: float = 0.0,
        speed_max: float = ANY_SPEED,
        quaternions: QuaternionOrder = "wxyz",
        trust_units: bool = False,
        **fields: Any,
    ) -> None:
        if isinstance(where, ConstantCurvature):
            system: LagrangianSystem = PointSystem(where, potential or _no_potential)
        elif potential is None:
            system = where
        else:
            raise FieldError("potential: allowed with a space of constant curvature; a system has its own forces")
        super().__init__(
            system, "riemannian_observer", noise, speed_max, quaternions, trust_units,
            {"bandwidth": bandwidth, **fields},
        )  # fmt: skip


class VelocityObserver(LagrangianObserver):
    """Observer of the joint velocities of a mechanism from its encoders, with its mass matrix as the metric (D.6).

    ``mechanism`` is the path of an MJCF file, a name ("two-link", "dm_control:acrobot", "menagerie:NAME"), or a
    ``mujoco.MjModel``. y is qpos (nq,) [m, rad], u is ctrl (nu,), the velocity is qvel (nv,) [m/s, rad/s].

    ``method`` is a plug-in: riemannian_observer, high_gain, momentum_observer, lagrangian_ekf, lagrangian_ukf or
    filtered_differences, and ``fields`` are its fields. ``noise`` [rad, m], ``speed_max``, ``quaternions`` and
    ``trust_units`` are those of an ``IntrinsicObserver``.

    Raises FieldError for a model that is not such a mechanism and for a field or a value that is not allowed,
    PluginError for an unknown method.
    """

    def __init__(
        self,
        mechanism: str | Path | mujoco.MjModel,
        method: str = "riemannian_observer",
        *,
        noise: float = 0.0,
        speed_max: float = ANY_SPEED,
        quaternions: QuaternionOrder = "wxyz",
        trust_units: bool = False,
        **fields: Any,
    ) -> None:
        with raising(FieldError):
            model = mechanism if isinstance(mechanism, mujoco.MjModel) else build_model(mechanism)
            system = MechanismSystem(model)
        super().__init__(system, method, noise, speed_max, quaternions, trust_units, fields)


def _no_potential(p: casadi.SX) -> casadi.SX:
    return casadi.SX(0.0)
