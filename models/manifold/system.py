"""Euler-Lagrange systems Sigma (D.2.2), as an observer may know them:

    x' = v,    D_t v = -grad U + F,    y = (x, F),

on a configuration manifold, the metric of which is the kinetic energy. What is called ``force`` here is -grad U + F:
it is always possible to move terms between the two. A state is (x, v), one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from mathnavi.models.manifold.manifold import Manifold
from mathnavi.sim.interfaces.signals import Array


class LagrangianSystem(Protocol):
    """A configuration manifold and what acts on it."""

    @property
    def manifold(self) -> Manifold:
        """X with its metric."""
        ...

    @property
    def states(self) -> tuple[str, ...]:
        """(size + vector_size,) name and unit of each component of the state."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """(nu,) name and unit of each component of the input."""
        ...

    @property
    def constant(self) -> tuple[float, ...]:
        """(nu,) u = constant + amplitude sin t is the input where nothing else is asked for."""
        ...

    @property
    def amplitude(self) -> tuple[float, ...]:
        """(nu,)"""
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
        """State (size + vector_size,) after h [s] from ``state`` with u (nu,) held; ``integrate`` for one."""
        ...


@runtime_checkable
class SteppedSystem(LagrangianSystem, Protocol):
    """A system whose steps are taken as a whole where forces at their ends are not enough, as of a stiff servo."""

    @property
    def implicit(self) -> bool:
        """True where steps have to be taken as a whole."""
        ...

    def step(self, x: Array, v: Array, u: Array, h: float, delta: Array | None = None) -> tuple[Array, Array]:
        """State x (size,), v (vector_size,) after h [s] from (x, v) with u (nu,) held.

        ``delta`` (vector_size,) is an acceleration that the model lacks. Raises ArithmeticError where it leads nowhere.
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
        """Return what the inputs do at x (size,), v (vector_size,)."""
        ...


@runtime_checkable
class ActuatedSystem(LagrangianSystem, Protocol):
    """A system that knows the laws of its actuators."""

    @property
    def coupled(self) -> int:
        """Dimensions that follow others by a constraint and need no input."""
        ...

    def affine_inputs(self) -> AffineInputLaw | None:
        """Affine inputs; None where a probe of the force shows all there is to know."""
        ...


def stepped(system: LagrangianSystem) -> SteppedSystem | None:
    """Return the system if its steps have to be taken as a whole, else None."""
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
