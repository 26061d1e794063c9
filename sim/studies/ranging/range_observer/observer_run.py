"""The range observer in a run, its errors in X and in Z, and whether it keeps lock."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.observability.region import ExactRun
from mathnavi.estimators.ranging.observer import RangeObserver, RangeObserverConfig
from mathnavi.models.angles import wrapped
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.convergence import LAST
from mathnavi.sim.metrics.ranging import HEADING, POSITION, rms

STRIDE = 5  # readings from one at which errors are taken to the next


@dataclass(frozen=True, eq=False)
class ObserverRun:
    """A run of the range observer, at every few readings."""

    run: ExactRun
    t: Array  # (n,) [s]
    x: Array  # (n, 3) estimate
    truth: Array  # (n, 3)
    z: Array  # (n, l + 1) estimate
    z_true: Array  # (n, l + 1) without jumps
    value: Array  # (n, 2) V_rho and |Q|^2 / 2
    error: Array  # (n, 3) x less its truth, modulo the symmetry of the wall
    error_z: Array  # (n, l + 1) z likewise

    @property
    def position(self) -> Array:
        """(n,) [m]."""
        length: Array = np.hypot(self.error[:, 0], self.error[:, 1])
        return length

    @property
    def in_z(self) -> Array:
        """(n,) [rad] the root mean square of the errors of the components of z."""
        size: Array = np.sqrt(np.square(self.error_z).mean(axis=1))
        return size

    @property
    def last(self) -> slice:
        """The last quarter, by which the run is judged."""
        return slice(round((1.0 - LAST) * (len(self.t) - 1)), None)


@dataclass(frozen=True)
class RunErrors:
    """Root mean squares over the last quarter of a run."""

    position: float  # [m]
    heading: float  # [rad]
    in_z: float  # [rad] of a component
    worst: float  # [m] the largest position error of the whole run
    relative_position: float  # over that of (x_1, x_2)
    relative_heading: float  # over that of phi

    @staticmethod
    def from_run(run: ObserverRun) -> RunErrors:
        """The errors of a run."""
        last, truth = run.last, run.truth
        position, heading = rms(run.position[last]), rms(run.error[last, 2])
        distance = rms(np.hypot(truth[last, 0], truth[last, 1]))
        return RunErrors(
            position,
            heading,
            rms(run.in_z[last]),
            float(run.position.max()),
            position / distance,
            heading / rms(truth[last, 2]),
        )

    @property
    def locked(self) -> bool:
        """Tell whether the estimate has converged in X."""
        return self.position < POSITION and self.heading < HEADING

    @property
    def locked_z(self) -> bool:
        """Tell whether the estimate has converged in Z."""
        return self.in_z < HEADING


def follow(run: ExactRun, config: RangeObserverConfig) -> ObserverRun:
    """The observer in a run, its errors modulo the symmetry of the wall."""
    mission, curve = run.mission, run.mission.curve
    made = RangeObserver.build(config, mission)
    estimates = [
        made.update(t, readings, command)
        for t, readings, command in zip(run.t, run.readings, run.commands, strict=True)
    ][::STRIDE]
    truth = run.truth[::STRIDE]
    x = np.array([estimate.x for estimate in estimates])
    z = np.array([estimate.extra["z"] for estimate in estimates])
    s = np.unwrap(np.array([curve.ranges(pose, mission.alpha)[1] for pose in truth]), axis=0)
    z_true = np.column_stack([s, truth[:, 2]])
    turns = 2.0 * math.pi / curve.symmetry * np.arange(curve.symmetry)  # of an ellipse, also by how much s is off
    images = wrapped(z[:, None] - z_true[:, None] - turns[:, None])
    nearest = np.square(images).sum(axis=2).argmin(axis=1)
    return ObserverRun(
        run, run.t[::STRIDE], x, truth, z, z_true,
        np.array([estimate.extra["value"] for estimate in estimates]),
        np.array([mission.difference(one, true) for one, true in zip(x, truth, strict=True)]),
        images[np.arange(len(z)), nearest],
    )  # fmt: skip
