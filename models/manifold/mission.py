"""Mission of an observer of a Lagrangian system: the system, the quality of its position sensor, its greatest speed.

**Sensors of a position**: an encoder at every joint, an attitude sensor, or a point of a manifold with noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval

from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import FINITE, Fraction, Positive, configuration
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold, quaternion_parts
from mathnavi.models.manifold.system import MODEL_FREE_ESTIMATORS, LagrangianSystem, require_modelled

POSITION = "position"  # the name of their readings
EncoderBits = Annotated[int, Interval(ge=0, le=32), FINITE]


@configuration
class PositionQuality:
    """Errors of a position reading, in coordinates of the manifold about the truth: of each joint, for a mechanism."""

    noise: Annotated[float, Radians(0.0, 1.0, unit="rad or m")] = 0.0
    """standard deviation of each coordinate of a reading [rad, m]"""
    resolution: EncoderBits = 0
    """resolution of an encoder, in bits per turn or per metre; 0 for none"""
    dropout: Fraction = 0.0
    """fraction of readings that are lost"""
    jump: Fraction = 0.0
    """fraction of readings with an error of jump_size in every coordinate"""
    jump_size: Annotated[float, Radians(0.0, 10.0, unit="rad or m")] = 0.0
    """error of such a reading in every coordinate [rad, m]"""


@dataclass(frozen=True)
class ManifoldPositionSensor:
    """Sensor of "position" (size,). The random numbers drawn do not depend on the size of the errors."""

    manifold: Manifold
    quality: PositionQuality
    rate: float | None  # [Hz]
    name: ClassVar[str] = POSITION

    @property
    def size(self) -> int:
        """Components of a reading, those of a point."""
        return self.manifold.size

    @property
    def quaternions(self) -> tuple[slice, ...]:
        """Places of quaternions in a reading."""
        return quaternion_parts(self.manifold)

    def check(self, y: Array) -> None:
        """Raise ArgumentError for a reading (size,) that is not a point of the manifold."""
        self.manifold.check(y)

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the position (size,) of the plant, with noise, jumps and rounding; None where the reading is lost."""
        manifold, quality = self.manifold, self.quality
        x = motion.x[: manifold.size]
        error = quality.noise * rng.standard_normal(manifold.dimension)
        lost, jumps = rng.random(2) < (quality.dropout, quality.jump)
        if jumps:
            error = error + quality.jump_size
        y = manifold.point(x, error) if error.any() else x
        return None if lost else manifold.rounded(y, quality.resolution)


@dataclass(frozen=True)
class StateSensor:
    """Sensor of "full_state", (x, v) without error: for comparison, no encoder measures it."""

    size: int
    rate: float | None  # [Hz]
    quaternions: tuple[slice, ...] = ()  # places in a reading
    name: ClassVar[str] = "full_state"

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the state (size,) of the plant exactly."""
        return motion.x


@configuration(eq=False)
class LagrangianMission:
    """Mission: find the velocity of a system from its position and its input. It holds no truth of a run.

    ``system`` is the assumed system. The state is (x, v), as ``system.states`` names it; at the start v is assumed to
    be zero, and x is the first reading.
    """

    system: LagrangianSystem
    reading: PositionQuality = field(default_factory=PositionQuality)
    period: Positive = 1e-3  # [s] of readings, estimates and commands
    speed_max: Positive = 100.0  # [rad/s, m/s] greatest rate of any joint or body, see ``greatest_rate``

    @property
    def input_size(self) -> int:
        """Number nu of inputs."""
        return len(self.system.inputs)

    @property
    def sensor(self) -> ManifoldPositionSensor:
        """Sensor of one run, with readings "position" (size,)."""
        return ManifoldPositionSensor(self.system.manifold, self.reading, 1.0 / self.period)

    # ---- for the estimator ``full_state``, which reads the velocity

    @property
    def control_period(self) -> float:
        """Period [s] of the estimates."""
        return self.period

    @property
    def start_state(self) -> Array:
        """State (size + vector_size,) (origin, 0): nothing is known of the start."""
        manifold = self.system.manifold
        return np.concatenate([manifold.origin, np.zeros(manifold.vector_size)])

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """State after the input u (nu,) was held for dt [s] from x (size + vector_size,)."""
        return self.system.flow(x, u, dt)

    def full_state_sensor(self, rate: float | None) -> StateSensor:
        """Sensor "full_state" at ``rate`` [Hz]; once a period if it is None.

        Raises FieldError for a lower rate where the system has parts that are not modelled: between two readings the
        state is predicted.
        """
        if rate is not None and rate < 1.0 / self.period:
            require_modelled(self.system, f"estimator = full_state at {rate:g} Hz", MODEL_FREE_ESTIMATORS)
        return StateSensor(len(self.system.states), rate or 1.0 / self.period, quaternion_parts(self.system.manifold))

    def full_state_covariance(self, age: float) -> Array:
        """Covariance (n, n) of a reading of any age: zero, for it has no error."""
        n = len(self.system.states)
        return np.zeros((n, n))

    def full_state_quality(self, rate: float | None, timeout: float) -> None:
        """None: the state is not certified."""
