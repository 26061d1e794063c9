"""Motion of the aerial vehicle: the double integrator p'' = a of the thesis (A.2), with the input held.

State x = (p, v), p (3,) [m] and v (3,) [m/s] in the map frame; input u = a (3,) [m/s^2], the net acceleration. With u
held over a time h the motion is, exactly,

    p(h) = p + v h + u h^2 / 2,        v(h) = v + u h.

The forward Euler step p + v h, as printed, leaves out u h^2 / 2: 56 m at a_max = 40 m/s^2 and h = 5/3 s. ``f`` and
``F`` are CasADi functions, the rest is the same in numpy; the tests compare everything with MuJoCo.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.kernels import arc_at, state_on
from mathnavi.models.tolerances import TIME_TOLERANCE

if TYPE_CHECKING:
    import casadi

TICK = 1.0 / 300.0  # [s] of the flight physics
CONTROL_TICKS = 5  # physics ticks per tick of estimator and tracker, unless a mission states another number
HULL_RADIUS = 0.5
"""radius [m] of the ball that collides, about the vehicle's centre (point_mass.xml)"""


@lru_cache(maxsize=1)
def continuous_dynamics() -> casadi.Function:
    """f(x (6,), u (3,)) -> x' (6,) [m/s, m/s^2], the double integrator (A.2)."""
    import casadi  # takes a while to import

    x, u = casadi.SX.sym("x", 6), casadi.SX.sym("u", 3)
    return casadi.Function("f", [x, u], [casadi.vertcat(x[3:], u)], ["x", "u"], ["x_dot"])


@lru_cache(maxsize=1)
def discrete_dynamics() -> casadi.Function:
    """F(x (6,), u (3,), h [s]) -> x (6,) after u was held for h, exact."""
    import casadi

    x, u, h = casadi.SX.sym("x", 6), casadi.SX.sym("u", 3), casadi.SX.sym("h")
    p, v = x[:3], x[3:]
    after = casadi.vertcat(p + v * h + u * h**2 / 2, v + u * h)
    return casadi.Function("F", [x, u, h], [after], ["x", "u", "h"], ["x_next"])


def flow(x: Array, u: Array, dt: float | Array) -> Array:
    """State (..., 6) [m, m/s] after the input u (..., 3) [m/s^2] was held for dt [s] from x (..., 6); ``F`` in numpy.

    dt is a number or an array (..., 1).
    """
    p, v = x[..., :3], x[..., 3:]
    after: Array = np.concatenate([p + dt * v + (0.5 * dt * dt) * u, v + dt * u], axis=-1)
    return after


def state_at(plan: Plan, t: float | Array) -> Array:
    """State of a plan at absolute time t [s]: (6,) [m, m/s] for a number, (n, 6) for an array (n,).

    Before the plan starts it is the plan's first state, after its end the state of rest in which it ends.
    """
    if not isinstance(t, np.ndarray):
        state: Array = state_on(plan.t, plan.x, plan.u, t)
        return state
    k = plan.t.searchsorted(t + TIME_TOLERANCE, side="right") - 1
    states: Array = plan.x[np.clip(k, 0, len(plan.u))]
    inside = (k >= 0) & (k < len(plan.u))
    arcs = k[inside]
    states[inside] = flow(plan.x[arcs], plan.u[arcs], (t[inside] - plan.t[arcs])[:, np.newaxis])
    return states


def input_at(plan: Plan, t: float) -> Array:
    """Input (3,) [m/s^2] of a plan from absolute time t [s] on; zero before its start and after its end."""
    k = arc_at(plan.t, t)
    held: Array = plan.u[k].copy() if 0 <= k < len(plan.u) else np.zeros(3)
    return held
