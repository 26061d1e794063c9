"""Euler-Lagrange systems Sigma (D.2.2), as an observer knows them:

    x' = v,    D_t v = -grad U + F,    y = (x, F),

on a configuration manifold, the metric of which is the kinetic energy. ``force`` is -grad U + F here: terms can always
be moved between the two. A state is (x, v), one after the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold


class LagrangianSystem(Protocol):
    """A configuration manifold and the forces that act on it."""

    @property
    def manifold(self) -> Manifold:
        """Configuration manifold X with its metric."""
        ...

    @property
    def states(self) -> tuple[str, ...]:
        """Name and unit (size + vector_size,) of each component of the state."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Name and unit (nu,) of each component of the input."""
        ...

    @property
    def constant(self) -> tuple[float, ...]:
        """Constant part (nu,) of the default input u = constant + amplitude sin t."""
        ...

    @property
    def amplitude(self) -> tuple[float, ...]:
        """Amplitude (nu,) of the default input."""
        ...

    @property
    def velocity_dependent(self) -> bool:
        """True if the force depends on the velocity."""
        ...

    def force(self, x: Array, v: Array, u: Array) -> Array:
        """Force D_t v (vector_size,), a tangent vector at x (size,), at the velocity v (vector_size,) under the input u
        (nu,).
        """
        ...

    def flow(self, state: Array, u: Array, h: float) -> Array:
        """State (size + vector_size,) after h [s] from ``state`` with u (nu,) held, for instance by ``integrate``."""
        ...


@runtime_checkable
class SteppedSystem(LagrangianSystem, Protocol):
    """A system that takes its own steps where forces at their ends are not enough, as with a stiff servo."""

    @property
    def implicit(self) -> bool:
        """True if the system has to take its own steps."""
        ...

    @property
    def constraint_acceleration(self) -> Array:
        """Acceleration (vector_size,) by which constraints, such as contacts, acted in the last step."""
        ...

    @property
    def touching(self) -> int:
        """Number of constraints of contacts and limits in the last step."""
        ...

    def step(self, x: Array, v: Array, u: Array, h: float, delta: Array | None = None) -> tuple[Array, Array]:
        """State x (size,), v (vector_size,) after h [s] from (x, v) with u (nu,) held.

        ``delta`` (vector_size,) is an acceleration that the model lacks. Raises ArithmeticError if the step diverges.
        """
        ...


@dataclass(frozen=True)
class AffineInputs:
    """D_t v = without + effect u at one state."""

    without: Array  # (n,)
    effect: Array  # (n, nu)
    least: Array  # (nu,)
    most: Array  # (nu,)


class AffineInputLaw(Protocol):
    """Affine inputs by the state."""

    def __call__(self, x: Array, v: Array) -> AffineInputs:
        """Return the affine inputs at x (size,), v (vector_size,)."""
        ...


@runtime_checkable
class ActuatedSystem(LagrangianSystem, Protocol):
    """A system that knows the laws of its actuators."""

    @property
    def coupled(self) -> int:
        """Dimensions that follow others by a constraint and need no input."""
        ...

    def affine_inputs(self) -> AffineInputLaw | None:
        """Affine inputs; None where a probe of the force is sufficient."""
        ...


class Closure(Protocol):
    """Constraints within a system, by which its positions and velocities are fewer than its coordinates."""

    def tangent(self, x: Array, c: Array) -> Array:
        """Displacement or velocity, in components (n,), that is allowed at x (size,), the nearest to c (n,), or those
        of the columns of c (n, k).
        """
        ...

    def nearest(self, x: Array) -> Array:
        """Position (size,) that is allowed, near x (size,)."""
        ...


def closure(system: LagrangianSystem) -> Closure | None:
    """Return the constraints of a system that names some as ``closure``; None of one that has none."""
    found: Closure | None = getattr(system, "closure", None)
    return found


class Step(Protocol):
    """Step of a system, as ``SteppedSystem.step``."""

    @property
    def constraint_acceleration(self) -> Array:
        """Constraint acceleration, as ``SteppedSystem.constraint_acceleration``."""
        ...

    @property
    def touching(self) -> int:
        """Number of constraints of contacts and limits, as ``SteppedSystem.touching``."""
        ...

    def __call__(self, x: Array, v: Array, u: Array, h: float, delta: Array | None = None) -> tuple[Array, Array]:
        """State x (size,), v (vector_size,) after h [s] from (x, v) with u (nu,) and delta (vector_size,) held."""
        ...


class UncertainParameters(Protocol):
    """Parameters theta (p,) of a system that it may have wrong, zero as it has them."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names (p,)."""
        ...

    @property
    def prior(self) -> Array:
        """Standard deviations (p,) before anything is known."""
        ...

    @property
    def delay(self) -> float:
        """Time [s] from a position to the middle of the input that goes with it in a step."""
        ...

    def within(self, u: Array) -> Array:
        """Inputs (nu,) within their ranges."""
        ...

    def lacking(self, q: Array, v: Array, a: Array, u: Array) -> tuple[Array, Array, Array]:
        """Torque (n,) that the system lacks at q, v and a (n,) with u (nu,) of ``delay`` later, what parameters add to
        it (n, p), and the share (n,) of each component that says something, 0 where it says nothing.
        """
        ...

    def applied(self, theta: Array) -> Step:
        """Return the step of the system with theta (p,)."""
        ...


def uncertain_parameters(system: LagrangianSystem) -> UncertainParameters | None:
    """Return the parameters that a system may have wrong; None of one that names none."""
    parameters: Callable[[], UncertainParameters | None] | None = getattr(system, "parameters", None)
    return None if parameters is None else parameters()


@runtime_checkable
class PartlyModelledSystem(LagrangianSystem, Protocol):
    """A system that says which of its parts ``force`` and ``flow`` lack, for (x, v) does not determine their state."""

    @property
    def unmodelled(self) -> str:
        """These parts, in words; "" if nothing is missing."""
        ...


def unmodelled(system: LagrangianSystem) -> str:
    """Return the parts of a system that its force and its flow lack, in words; "" if nothing is missing."""
    return system.unmodelled if isinstance(system, PartlyModelledSystem) else ""


def require_modelled(system: LagrangianSystem, user: str, instead: str) -> None:
    """Raise FieldError if a system has parts that ``user``, "estimator = NAME", lacks; ``instead`` may be used."""
    if parts := unmodelled(system):
        raise FieldError(f"{user} with {parts}, which it does not model; allowed: {instead}")


MODEL_FREE_ESTIMATORS = "filtered_differences, or full_state at the rate of the estimates"
"""estimators of a system whose parts are not all modelled"""


def stepped(system: LagrangianSystem) -> SteppedSystem | None:
    """Return the system if it has to take its own steps, else None."""
    return system if isinstance(system, SteppedSystem) and system.implicit else None


def integrate(system: LagrangianSystem, state: Array, u: Array, h: float) -> Array:
    """Integrate the state (size + vector_size,) over h [s] with u (nu,) held, to the second order in h: a geodesic bent
    by the force.

        x^+ = exp_x(h v + h^2 F / 2),    v^+ = PT(v + h F / 2) + h F^+ / 2,

    F^+ being that at x^+ and, where it depends on the velocity, PT(v + h F).
    """
    manifold = system.manifold
    x, v = state[: manifold.size], state[manifold.size :]
    F = system.force(x, v, u)
    after = manifold.exp(x, h * v + (0.5 * h * h) * F)
    half = manifold.transport(x, after, v + (0.5 * h) * F)
    end = manifold.transport(x, after, v + h * F) if system.velocity_dependent else half
    return np.concatenate([after, half + (0.5 * h) * system.force(after, end, u)])
