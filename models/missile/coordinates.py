"""Coordinates of a missile's flight: in the pitch plane (``PLANAR``), or in space (``SPATIAL``).

The *state* x is the thesis' (z down, velocities in the body frame); estimates and plans contain it. The *joint
coordinates* (q, q') are MuJoCo's (z up, velocities in the world frame); the plant has them. ``Coordinates`` converts
one to the other and back, propagates a state, and finds the input for an acceleration.

A *place* is a point or vector of the Earth frame (X_e, Y_e, Z_e), always (3,), y_e = 0 in the pitch plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import casadi
import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Integers, Plan
from mathnavi.models.missile import kernels
from mathnavi.models.missile.dynamics import (
    NOMINAL,
    PITCH_INPUTS,
    PITCH_STATES,
    SPATIAL_INPUTS,
    SPATIAL_STATES,
    UNITS,
    Body,
    pitch_dynamics,
    spatial_dynamics,
)
from mathnavi.models.tolerances import TIME_TOLERANCE

STEP = 0.005
"""longest Runge-Kutta step [s] of ``flow``: turning at 2 rad/s its error after 8 s is 1.2e-7 m"""

_JOINTS = ("x", "y", "z", "theta", "psi")


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Names, sizes and motion of a missile's state.

    Every function takes one state (nx,), or one in each row (n, nx), and float64.
    """

    name: str
    states: tuple[str, ...]  # nx names
    inputs: tuple[str, ...]  # nu names
    joints: tuple[str, ...]  # nj = nx / 2 names of MuJoCo's joints
    dynamics: Callable[[Body], casadi.Function]  # f(x, u) -> x'

    @property
    def state_size(self) -> int:
        """Number nx of states."""
        return len(self.states)

    @property
    def input_size(self) -> int:
        """Number nu of inputs."""
        return len(self.inputs)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Units (nx,) of the states."""
        return tuple(UNITS[name] for name in self.states)

    def index(self, name: str) -> int:
        """Index of a state or an input by its name."""
        return (self.states if name in self.states else self.inputs).index(name)

    @cached_property
    def position(self) -> Integers:
        """Indices of x_e, (y_e,) z_e in the state."""
        return np.array([self.index(name) for name in ("x_e", "y_e", "z_e") if name in self.states])

    @cached_property
    def angles(self) -> Integers:
        """Indices of the angles in the state; their differences are to be wrapped."""
        return np.array([k for k, unit in enumerate(self.units) if unit == "rad"])

    def in_space(self, x: Array) -> Array:
        """Spatial state (..., 10) of a state x (..., nx)."""
        return _spread(x, self._state_places, len(SPATIAL_STATES))

    def input_in_space(self, u: Array) -> Array:
        """Spatial input (..., 5) [N, N m] of an input u (..., nu)."""
        return _spread(u, self._input_places, len(SPATIAL_INPUTS))

    def place(self, x: Array) -> Array:
        """Position (..., 3) [m] in the Earth frame of a state x (..., nx)."""
        return self.in_space(x)[..., 7:]

    def velocity(self, x: Array) -> Array:
        """Velocity (..., 3) [m/s] in the Earth frame of a state x (..., nx)."""
        joints = self._rows(kernels.to_joints, self.in_space(x))
        return joints[..., 5:8] * (1.0, -1.0, -1.0)

    def nose(self, x: Array) -> Array:
        """Unit vector (..., 3) of the Earth frame along X_b, of a state x (..., nx)."""
        x = self.in_space(x)
        theta, psi = x[..., 5], x[..., 6]
        return np.stack([np.cos(theta) * np.cos(psi), np.sin(psi), -np.sin(theta) * np.cos(psi)], axis=-1)

    def from_joints(self, joints: Array) -> Array:
        """State (..., nx) of MuJoCo's joint coordinates and rates (qpos, qvel) (..., nx)."""
        spread = _spread(joints, self._joint_places, 2 * len(_JOINTS))
        return self._rows(kernels.from_joints, spread)[..., self._state_places]

    def to_joints(self, x: Array) -> Array:
        """MuJoCo's (qpos, qvel) (..., nx) of a state x (..., nx)."""
        return self._rows(kernels.to_joints, self.in_space(x))[..., self._joint_places]

    def joint_acceleration(self, x: Array, u: Array, body: Body = NOMINAL) -> Array:
        """Acceleration q'' (..., nj) of MuJoCo's joints at x (..., nx) under u (..., nu) [N, N m]."""
        kernel = partial(kernels.joint_accelerations, numbers=body.numbers)
        made = self._rows(kernel, self.in_space(x), self.input_in_space(u))
        return made[..., self._half_places]

    def inverse_dynamics(self, x: Array, joint_acceleration: Array, body: Body = NOMINAL) -> Array:
        """Input (..., nu) [N, N m] under which MuJoCo's joints have q'' (..., nj) at x (..., nx): the body is fully
        actuated.
        """
        kernel = partial(kernels.inverse_dynamics, numbers=body.numbers)
        wanted = _spread(joint_acceleration, self._half_places, len(_JOINTS))
        return self._rows(kernel, self.in_space(x), wanted)[..., self._input_places]

    def rate(self, x: Array, u: Array, body: Body = NOMINAL) -> Array:
        """Rate x' (..., nx) at x (..., nx) under u (..., nu) [N, N m]; ``dynamics`` in numpy."""
        kernel = partial(kernels.rates, numbers=body.numbers)
        made = self._rows(kernel, self.in_space(x), self.input_in_space(u))
        return made[..., self._state_places]

    def flow(self, x: Array, u: Array, dt: float, body: Body = NOMINAL) -> Array:
        """State (nx,) after the input u (nu,) [N, N m] was held for dt [s] from x (nx,)."""
        after = kernels.flow(self.in_space(x), self.input_in_space(u), float(dt), body.numbers, STEP)
        return after[self._state_places]

    def flow_through(self, x: Array, u: Array, durations: Sequence[float], body: Body = NOMINAL) -> Array:
        """State (nx,) after the inputs u (n, nu) [N, N m] were held for ``durations`` (n,) [s] one after the other
        from x (nx,): as n calls of ``flow``.
        """
        now, numbers = self.in_space(x), body.numbers
        for held, dt in zip(self.input_in_space(u), durations, strict=True):
            now = kernels.flow(now, held, float(dt), numbers, STEP)
            now[self._other_places] = 0.0
        return now[self._state_places]

    def state_at(self, plan: Plan, t: float | Array, body: Body = NOMINAL) -> Array:
        """State of a plan at absolute time t [s]: (nx,) for a number, (n, nx) for an array (n,).

        Within an arc the body flies on from the arc's first state. Before the plan starts it is its first state; its
        last arc goes on after its end.
        """
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        x, u = self.in_space(plan.x), self.input_in_space(plan.u)
        states = kernels.states_on(plan.t.astype(np.float64), x, u, times, body.numbers, STEP)
        states = states[:, self._state_places]
        return states if isinstance(t, np.ndarray) else states[0]

    def input_at(self, plan: Plan, t: float) -> Array:
        """Input (nu,) [N, N m] of a plan from time t [s] on: that of its first arc before, of its last one after."""
        arc = int(plan.t.searchsorted(t + TIME_TOLERANCE, side="right")) - 1
        held: Array = plan.u[min(max(arc, 0), len(plan.u) - 1)].copy()
        return held

    # ---- places among the names of the spatial body

    @cached_property
    def _state_places(self) -> Integers:
        return _places(self.states, SPATIAL_STATES)

    @cached_property
    def _other_places(self) -> Integers:
        return np.setdiff1d(np.arange(len(SPATIAL_STATES)), self._state_places)

    @cached_property
    def _input_places(self) -> Integers:
        return _places(self.inputs, SPATIAL_INPUTS)

    @cached_property
    def _half_places(self) -> Integers:
        return _places(self.joints, _JOINTS)

    @cached_property
    def _joint_places(self) -> Integers:
        return np.concatenate([self._half_places, self._half_places + len(_JOINTS)])

    @staticmethod
    def _rows(kernel: Callable[..., Array], *arrays: Array) -> Array:
        """Apply a kernel of rows to arrays of one row or of several."""
        several = arrays[0].ndim > 1
        made: Array = kernel(*(arrays if several else [array[np.newaxis] for array in arrays]))
        return made if several else made[0]


def _places(names: tuple[str, ...], among: tuple[str, ...]) -> Integers:
    return np.array([among.index(name) for name in names])


def _spread(values: Array, places: Integers, size: int) -> Array:
    """Values (..., k) at their places among ``size``, zeros elsewhere."""
    if values.shape[-1] != len(places):
        raise ArgumentError(f"an array has shape {values.shape}; allowed: {len(places)} in its last dimension")
    spread: Array = np.zeros((*values.shape[:-1], size))
    spread[..., places] = values
    return spread


PLANAR = Coordinates("planar", PITCH_STATES, PITCH_INPUTS, ("x", "z", "theta"), pitch_dynamics)
SPATIAL = Coordinates("spatial", SPATIAL_STATES, SPATIAL_INPUTS, _JOINTS, spatial_dynamics)
COORDINATES = {coordinates.name: coordinates for coordinates in (PLANAR, SPATIAL)}
