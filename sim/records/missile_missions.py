"""Record of the mission of a missile in config.json."""

from __future__ import annotations

from dataclasses import dataclass

from mathnavi.models.missile.mission import Case, Target


@dataclass(frozen=True)
class MissileRecord:
    """Dive of a missile, in the thesis' Earth frame (z down), whose X_e has the ``azimuth``."""

    dimension: str  # of ``mathnavi.models.missile.coordinates.COORDINATES``
    start: tuple[float, ...]  # (nx,)
    target: tuple[Target, ...]  # the legs of its motion
    aspect_angle: float  # [rad] above the horizontal
    input_max: tuple[float, ...]  # (nu,)
    miss_allowed: float  # [m]
    aspect_allowed: float | None = None  # [deg]
    case: Case | None = None
    azimuth: float = 0.0  # [deg] of X_e from the x of the world, to the left: ``mathnavi.models.missile.mission``
