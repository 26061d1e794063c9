"""Data of a finished missile run for pictures: path, plans and target in the world's frame (x ahead, y left, z up).

The world is turned by the azimuth of the run (``mathnavi.models.missile.mission``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import COORDINATES, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL
from mathnavi.models.missile.mission import TargetMotion
from mathnavi.renders.logged_run import LoggedRun
from mathnavi.sim.metrics.missile import Approach, attack_angles, closest_approach, references
from mathnavi.sim.records.missile_missions import MissileRecord
from mathnavi.sim.records.missions import read_mission
from mathnavi.sim.records.run_folder import ARRAYS, CONFIG, RunLog, read_log

TO_WORLD = np.array([1.0, -1.0, -1.0])  # from the Earth frame, whose z is down, and back


def _world(place: Array) -> Array:
    turned: Array = place * TO_WORLD
    return turned


@dataclass(frozen=True, eq=False)
class MissileRun(LoggedRun):
    """The run of one missile."""

    coordinates: Coordinates
    target: TargetMotion
    aspect_angle: float  # [rad]
    azimuth: float  # [rad] of the frame of the run from the x of the world, to the left
    input_max: Array  # (nu,)
    miss_allowed: float  # [m]
    aspect_allowed: float | None  # [deg]; None where it is not recorded
    case: str  # "" where it is not recorded
    weight: float  # [N] m g, the unit of forces

    @cached_property
    def x(self) -> Array:
        """(n, nx) the true state, as the thesis has it."""
        return self.coordinates.from_joints(self.log.x)

    @cached_property
    def path(self) -> Array:
        """(n, 3) [m] world frame."""
        return _world(self.coordinates.place(self.x))

    @cached_property
    def u(self) -> Array:
        """(n, nu) the commands of the thrusters, within their limits."""
        return np.clip(self.log.u, -self.input_max, self.input_max)

    @cached_property
    def attack(self) -> Array:
        """(n,) [rad] between nose and velocity."""
        return attack_angles(self.x, self.coordinates)

    @cached_property
    def speed(self) -> Array:
        """(n,) [m/s]."""
        speed: Array = np.linalg.norm(self.coordinates.velocity(self.x), axis=1)
        return speed

    @cached_property
    def reference(self) -> Array:
        """(n, nx) the state of the plan being flown; NaN before the first."""
        plans = [(float(t), plan) for t, plan in zip(self.log.adopted, self.log.plans, strict=True)]
        return references(self.t, plans, self.coordinates, NOMINAL)

    @cached_property
    def approach(self) -> Approach:
        """Time and distance of the closest approach to the target."""
        return closest_approach(self.t, self.log.x, self.coordinates, self.target)

    def joints(self, t: float) -> Array:
        """(nx,) MuJoCo's joint coordinates and rates at ``t`` [s], linear between samples."""
        return self.interpolated(self.log.x, t)

    def place(self, t: float) -> Array:
        """(3,) [m] world frame: the missile at ``t`` [s], linear between samples."""
        return _world(self.coordinates.place(self.coordinates.from_joints(self.joints(t))))

    def axes(self, t: float) -> Array:
        """(3, 3) the axes X_b, Y_b, Z_b of the body as columns, world frame."""
        x = self.coordinates.in_space(self.coordinates.from_joints(self.joints(t)))
        theta, psi = float(x[5]), float(x[6])
        s, c, sin, cos = math.sin(theta), math.cos(theta), math.sin(psi), math.cos(psi)
        axes: Array = TO_WORLD[:, None] * np.array([[c * cos, -c * sin, s], [sin, cos, 0.0], [-s * cos, s * sin, c]])
        return axes

    def plan_ahead(self, t: float, points: int) -> Array:
        """(points, 3) [m] world frame: what is left of the plan being flown at ``t`` [s]; (0, 3) if nothing is.

        The points are the denser the nearer they are.
        """
        plan = self.plan(t)
        if plan is None or t >= plan.t_end:
            return np.empty((0, 3))
        times = t + (plan.t_end - t) * np.linspace(0.0, 1.0, points) ** 1.7
        states = self.coordinates.state_at(plan, times)
        return _world(self.coordinates.place(states))

    def target_at(self, t: float) -> Array:
        """(3,) [m] world frame."""
        return _world(self.target.at(t))

    def distance(self, t: float) -> float:
        """[m] between the missile and its target at ``t`` [s]."""
        return float(np.linalg.norm(self.place(t) - self.target_at(t)))

    def target_velocity(self, t: float) -> Array:
        """(3,) [m/s] world frame."""
        return _world(self.target.velocity(t))


def load_run(directory: str | Path) -> MissileRun:
    """Read a run's folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    log = read_log(directory)
    try:
        run = _described(log, read_mission(MissileRecord, log.config["mission"]))
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(f"{str(log.directory / CONFIG)!r} does not describe a missile: {error!r}") from None
    sizes = run.coordinates.state_size, run.coordinates.input_size
    if (log.x.shape[1], log.u.shape[1]) != sizes:
        raise RunFolderError(
            f"{str(log.directory / ARRAYS)!r}: truth.x {log.x.shape} and command.u {log.u.shape} are not those of "
            f"{run.coordinates.name} flight, (n, {sizes[0]}) and (n, {sizes[1]})"
        )
    return run


def _described(log: RunLog, mission: MissileRecord) -> MissileRun:
    return MissileRun(
        log,
        COORDINATES[mission.dimension],
        TargetMotion(mission.target),
        mission.aspect_angle,
        math.radians(mission.azimuth),
        np.array(mission.input_max),
        mission.miss_allowed,
        mission.aspect_allowed,
        "" if mission.case is None else f"case {mission.case.name}",
        NOMINAL.mass * NOMINAL.gravity,
    )
