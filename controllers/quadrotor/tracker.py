"""The quadrotor's tracker: plan and estimate to the thrusts of the rotors, by geometric control on SE(3).

After T. Lee, M. Leok, N. H. McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)" (CDC 2010). With the
reference (p_r, v_r, a_r, j_r) described below, e_p = p - p_r, e_v = v - v_r, the wanted thrust per mass is

    f = a_r + g e_z + R D R' v / m - K,    K = k_p e_p + k_v e_v + d^,    k_p = omega_p^2, k_v = 2 zeta_p omega_p.

It is held to a greatest tilt. R_d has b_3 along f and its nose along the reference's velocity, turning no faster than
``turn_max``; Omega_d follows from f' = j_r - k_p e_v - k_v (v'^ - a_r) + R D R' v'^ / m. The rotors are commanded

    T = m (f + tau_m f') . b_3,
    tau = J (-k_R e_R - k_Omega e_Omega + ...) + omega x J omega,    k_R = omega_R^2, k_Omega = 2 zeta_R omega_R,

where tau_m f' and the rates of the reference tau_m ahead make up for the lag of the rotors. e_R is the gradient of Psi
= 4 - 2 sqrt(1 + tr R_d' R) instead of the paper's tr(I - R_d' R) / 2: it grows up to an attitude that is upside down,
where the paper's vanishes. ``mathnavi.models.quadrotor.allocation`` says which of T and tau is kept where rotors
saturate.

d^ is the observed effect of forces that are not in the model, a wind or a wrong mass, and the integral action of the
loop: with the modelled v'^ = R (0, 0, T^) / m - g e_z - R D R' v / m + d^ and the residual r of the velocity
against its integral, an observer with both poles at -omega_d; no more than ``disturbance_max`` of it is made up for.
T^ are the rotors' thrusts by their lag.

The estimate is x = (p, v) with extra["attitude"], the quaternion (4,), and extra["rate"], omega (3,).

A reference that a quadrotor can follow, near a plan whose accelerations jump.

The plan's arcs have constant accelerations; an attitude cannot jump with them. The reference (p_r, v_r, a_r, j_r) is
the state of a chain of four integrators that is led onto the plan,

    p_r'''' = -omega^4 (p_r - p) - 4 omega^3 (v_r - v) - 6 omega^2 (a_r - a) - 4 omega j_r,

(p, v, a) the plan's. All four poles are at -omega, and on a long arc the reference is the plan. With a ``preview`` d it
is led not onto the plan's present arc but onto the one that holds at t + d, extended back to t: a turn that is known is
begun before.

A jump of the acceleration by Delta at t = 0 leaves p_r - p = Delta psi(t) from -d on. With d = 0, psi = -e^(-omega t)
(t^2 / 2) (1 + omega t), at most 0.907 / omega^2. For every plan with |a| <= A, however often it turns,

    |p_r - p| <= A V(psi),   |v_r - v| <= A V(psi'),   |a_r| <= A V(1_{t > 0} + psi''),

V the total variation (1.813 / omega^2 of psi where d = 0). ``deviation`` computes them. A plan that takes over
unforeseen turns as with d = 0, so a bound is the greater of the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from annotated_types import Interval, Le

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.quadrotor.kernels import (
    advanced,
    attitude_of,
    limited,
    moments,
    rates_of,
    target_at,
    within_tilt,
)
from mathnavi.interfaces.angles import Degrees, Radians
from mathnavi.interfaces.bounds import FINITE, Fraction, NonNegative, Positive, configuration
from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.aerial.kernels import arc_at
from mathnavi.models.quadrotor.allocation import allocated
from mathnavi.models.quadrotor.dynamics import Quadrotor
from mathnavi.models.quaternion import rotation

_LONG = 40.0  # 1 / omega, after which a jump is forgotten
_POINTS = 8001


@dataclass(frozen=True)
class Deviation:
    """Bound on the deviation of the reference from a plan with |a| <= 1 m/s^2."""

    position: float  # [s^2] of |p_r - p|
    velocity: float  # [s] of |v_r - v|
    acceleration: float  # |a_r|


@lru_cache(maxsize=8)
def deviation(bandwidth: float, preview: float) -> Deviation:
    """The total variations of what one jump leaves, at a bandwidth omega [rad/s] and a preview d [s]."""
    t = np.linspace(-preview, _LONG / bandwidth, _POINTS)
    # One jump of 1 m/s^2 at t = 0, as a plan; the reference from -preview on.
    breaks, x = np.array([-2.0 * preview - 1.0, 0.0, t[-1] + 1.0]), np.zeros((3, 6))
    x[2, [0, 3]] = 0.5 * breaks[2] ** 2, breaks[2]
    u = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    start = np.zeros((4, 3))
    z = np.array([advanced(start, breaks, x, u, -preview, float(at), preview, bandwidth)[:, 0] for at in t])
    after = np.maximum(t, 0.0)
    errors = z[:, 0] - 0.5 * after**2, z[:, 1] - after, z[:, 2]
    return Deviation(*(float(np.abs(np.diff(part)).sum()) for part in errors))


class ReferenceFilter:
    """Filter of the plan being flown to the reference."""

    def __init__(self, bandwidth: float, preview: float, apart: float) -> None:
        """``apart`` [m, m/s] is the greatest deviation of the reference from the plan; beyond it, it restarts there."""
        self._bandwidth, self._preview, self._apart = bandwidth, preview, apart
        self._t = np.nan  # [s]
        self._z = np.zeros((4, 3))

    def at(self, plan: Plan, t: float) -> Array:
        """Reference (4, 3) p_r, v_r, a_r, j_r at t [s], which does not go back."""
        wanted = target_at(plan.t, plan.x, plan.u, arc_at(plan.t, t), t)
        if not np.isnan(self._t):
            self._z = self.ahead(plan, t)
        if np.isnan(self._t) or not np.abs(self._z[:2] - wanted[:2]).max() <= self._apart:
            self._z = wanted.copy()
            self._z[2] = 0.0  # a vehicle that is level
        self._t = t
        return self._z

    def ahead(self, plan: Plan, t: float) -> Array:
        """Reference (4, 3) at t [s] if the plan stays."""
        z: Array = advanced(self._z, plan.t, plan.x, plan.u, self._t, t, self._preview, self._bandwidth)
        return z


LEAST_THRUST = 0.15
"""least vertical part of f as a fraction of g, so that the thrust always points up"""
_FASTEST = 0.2  # of the attitude's bandwidth times the period: commands are held over a period
_TURNING = 0.8  # [m/s] least speed at which the nose turns into it
_TURN_BANDWIDTH, _TURN_ACCELERATION = 3.0, 4.0  # [rad/s, rad/s^2] of the heading
_APART = 1.0  # [m, m/s] of a plan from the reference: no plan that joins it is that far away
_SHORTEST = 0.5  # norm of an attitude's quaternion: a filter's may differ from 1, one near zero is no attitude
_MISSING = np.empty(0)
_VERTICAL = np.array([0.0, 0.0, 1.0])
NaturalFrequency = Annotated[float, Interval(ge=0.01, le=1e4), FINITE]  # [rad/s]
DampingRatio = Annotated[float, Interval(ge=0.01, le=100.0), FINITE]


@configuration
class TrackerConfig:
    """Gains of the tracker, as natural frequencies [rad/s] and damping ratios, and its limits."""

    position_bandwidth: NaturalFrequency = 3.0
    """natural frequency omega_p of the position loop [rad/s]"""
    position_damping: DampingRatio = 0.9
    """damping ratio zeta_p of the position loop"""
    attitude_bandwidth: NaturalFrequency = 14.0
    """natural frequency omega_R of the attitude loop about the axes that tilt the thrust [rad/s]"""
    attitude_damping: DampingRatio = 0.8
    """damping ratio zeta_R of the attitude loop"""
    yaw_bandwidth: NaturalFrequency = 4.0
    """natural frequency omega_R of the attitude loop about the axis of the thrust [rad/s]"""
    disturbance_bandwidth: NaturalFrequency = 6.0
    """bandwidth omega_d of the observer of unknown forces [rad/s]"""
    disturbance_max: Positive = 5.0
    """greatest unknown force per mass that is compensated [m/s^2]"""
    feedback_max: Positive = 8.0
    """greatest feedback k_p e_p + k_v e_v [m/s^2]"""
    reference_bandwidth: NaturalFrequency = 6.0
    """bandwidth omega of the reference filter [rad/s]"""
    preview: Annotated[NonNegative, Le(2.0)] = 0.37
    """time by which the reference begins a turn before the plan does [s]"""
    tilt_max: Annotated[float, Degrees(0.0, 80.0, open_low=True)] = 60.0
    """greatest tilt that is commanded [deg]"""
    turn_max: Annotated[float, Radians(0.0, 20.0, open_low=True, unit="rad/s")] = 1.5
    """greatest yaw rate of the nose [rad/s]"""
    mass_tolerance: Fraction = 0.1
    """share by which the mass may exceed the assumed one in the tracking bound"""
    drag_tolerance: Fraction = 0.25
    """share by which the drag may differ from the assumed one in the tracking bound"""

    def __post_init__(self) -> None:
        if not self.position_bandwidth <= 0.5 * self.attitude_bandwidth:
            raise FieldError(
                f"position_bandwidth = {self.position_bandwidth!r}; allowed: at most half of attitude_bandwidth = "
                f"{self.attitude_bandwidth!r}, or position and attitude fight each other"
            )

    @classmethod
    def held_for(cls, period: float) -> TrackerConfig:
        """Make the default gains, or where commands are held for too long a ``period`` [s], slower ones."""
        attitude = min(cls.attitude_bandwidth, _FASTEST / period)
        return cls(position_bandwidth=min(cls.position_bandwidth, 0.5 * attitude), attitude_bandwidth=attitude)


class GeometricTracker:
    """Tracker of the last accepted plan with four rotors, to rest and beyond."""

    def __init__(self, period: float, config: TrackerConfig, vehicle: Quadrotor, bound: TrackingBound) -> None:
        """``vehicle`` is the model that the controller assumes; ArgumentError for gains too high for the period [s]."""
        if not 0.0 < period * config.attitude_bandwidth <= _FASTEST:
            raise ArgumentError(
                f"attitude_bandwidth = {config.attitude_bandwidth!r}; allowed: > 0 and <= {_FASTEST / period:g} rad/s "
                f"at a control_rate of {1.0 / period:g} Hz"
            )
        self.period, self.bound = period, bound
        self._config, self._vehicle = config, vehicle
        self._reference = ReferenceFilter(config.reference_bandwidth, config.preview, _APART)
        self._k_p = config.position_bandwidth**2
        self._k_v = 2.0 * config.position_damping * config.position_bandwidth
        bandwidths = np.array([config.attitude_bandwidth, config.attitude_bandwidth, config.yaw_bandwidth])
        self._k_R, self._k_Omega = bandwidths**2, 2.0 * config.attitude_damping * bandwidths
        self._inertia, self._drag = np.array(vehicle.inertia), np.array(vehicle.drag)
        self._inverse = np.asarray(np.linalg.inv(vehicle.allocation), dtype=np.float64)
        self._tangent = math.tan(math.radians(config.tilt_max))
        self._gravity = vehicle.gravity * _VERTICAL
        # State from one command to the next.
        self._t = math.nan  # [s]
        self._thrusts = np.full(4, vehicle.hover_thrust)  # [N] T^
        self._asked = self._thrusts  # [N] held since the last command
        self._force = np.zeros(3)  # [m/s^2] modelled v'^ without d^, at the last command
        self._velocity = np.zeros(3)  # [m/s] of the observer
        self._disturbance = np.zeros(3)  # [m/s^2] d^
        self._heading, self._turn = 0.0, 0.0  # [rad], [rad/s]

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """The thrusts (4,) [N] to hold from t [s] on; ValueError for an estimate that is not a quadrotor's."""
        p, v, R, omega = _split(estimate)
        began = math.isnan(self._t)
        z = self._reference.at(plan, t)
        self._observe(t, v, R, began)
        self._turn_nose(z[1], R, began)
        vehicle, lag = self._vehicle, self._vehicle.motor_lag

        acceleration = self._force + self._disturbance
        feedback = self._k_p * (p - z[0]) + self._k_v * (v - z[1])
        within = limited(feedback, self._config.feedback_max)
        drag: Array = R @ (self._drag * (R.T @ v)) / vehicle.mass
        unknown = limited(self._disturbance, self._config.disturbance_max)
        f = z[2] - within - unknown + self._gravity + drag
        f_dot = z[3] + R @ (self._drag * (R.T @ acceleration)) / vehicle.mass
        if within @ within >= feedback @ feedback:  # a feedback at its limit hardly changes
            f_dot = f_dot - self._k_p * (v - z[1]) - self._k_v * (acceleration - z[2])
        f = within_tilt(f, LEAST_THRUST * vehicle.gravity, self._tangent)
        R_d = attitude_of(f, self._heading)
        omega_d = rates_of(R_d, f, f_dot, self._heading, self._turn)

        b_3 = R[:, 2]
        T = vehicle.mass * float((f + lag * f_dot) @ b_3)
        tau = moments(
            R, omega, R_d, omega_d, self._reference_turning(plan, t + lag), self._inertia, self._k_R, self._k_Omega
        )
        self._asked = allocated(np.array([T, *tau]), self._inverse, vehicle.thrust_max)
        return self._asked.copy()

    def _reference_turning(self, plan: Plan, t: float) -> Array:
        """Omega_d' (3,) [rad/s^2] of the reference alone over the period from t on, t a little ahead."""
        rates = []
        for at in (t, t + self.period):
            z = self._reference.ahead(plan, at)
            f = within_tilt(z[2] + self._gravity, LEAST_THRUST * self._vehicle.gravity, self._tangent)
            rates.append(rates_of(attitude_of(f, self._heading), f, z[3], self._heading, 0.0))
        turning: Array = (rates[1] - rates[0]) / self.period
        return turning

    def _observe(self, t: float, v: Array, R: Array, began: bool) -> None:
        """Propagate the rotors' thrusts and the disturbance to t [s]."""
        dt = 0.0 if began else t - self._t
        decay = math.exp(-dt / self._vehicle.motor_lag)
        self._thrusts = self._asked + decay * (self._thrusts - self._asked)
        m = self._vehicle.mass
        force = (self._thrusts.sum() * R[:, 2] - R @ (self._drag * (R.T @ v))) / m - self._gravity
        if began:
            self._velocity = v.copy()
        elif dt > 0.0:
            predicted = self._velocity + dt * (0.5 * (self._force + force) + self._disturbance)
            residual = v - predicted
            pole = math.exp(-self._config.disturbance_bandwidth * dt)
            self._velocity = predicted + (1.0 - pole * pole) * residual
            self._disturbance = self._disturbance + (1.0 - pole) ** 2 / dt * residual
        self._force, self._t = force, t

    def _turn_nose(self, velocity: Array, R: Array, began: bool) -> None:
        """Turn the heading for one period towards the reference's velocity, if it moves."""
        if began:
            self._heading = math.atan2(R[1, 0], R[0, 0])
        fast = math.hypot(velocity[0], velocity[1]) > _TURNING
        wanted = math.atan2(velocity[1], velocity[0]) if fast else self._heading
        angle = math.remainder(wanted - self._heading, 2.0 * math.pi)
        push = _TURN_BANDWIDTH**2 * angle - 2.0 * _TURN_BANDWIDTH * self._turn
        push = min(max(push, -_TURN_ACCELERATION), _TURN_ACCELERATION)
        most = self._config.turn_max
        self._turn = min(max(self._turn + push * self.period, -most), most)
        self._heading = math.remainder(self._heading + self._turn * self.period, 2.0 * math.pi)


def unflyable(estimate: Estimate) -> str:
    """Reason why a quadrotor cannot be flown with an estimate; "" if it can."""
    for name, value, size in (
        ("state", estimate.x, 6),
        ("attitude", estimate.extra.get("attitude", _MISSING), 4),
        ("rate", estimate.extra.get("rate", _MISSING), 3),
    ):
        if value.shape != (size,) or not math.isfinite(value.dot(value)):  # norms are made of the squares
            got = "missing" if value is _MISSING else f"{value.tolist()}"
            return f"the estimate's {name} is {got}; allowed: {size} finite numbers"
    attitude = estimate.extra["attitude"]
    length = math.sqrt(attitude.dot(attitude))
    if not _SHORTEST < length < 1.0 / _SHORTEST:
        return f"the estimate's attitude {attitude.tolist()} has length {length:.4g}; allowed: about 1"
    return ""


def _split(estimate: Estimate) -> tuple[Array, Array, Array, Array]:
    """p, v, R and omega of an estimate."""
    if reason := unflyable(estimate):
        raise ArgumentError(reason)
    attitude = estimate.extra["attitude"]
    return estimate.x[:3], estimate.x[3:], rotation(attitude / float(np.linalg.norm(attitude))), estimate.extra["rate"]
