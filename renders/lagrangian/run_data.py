"""Data of a run of a Lagrangian system for pictures: true and estimated positions and velocities."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.estimators.riemannian.gains import DEFAULT_BANDWIDTH, IntrinsicGains
from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.constant_curvature import hyperbolic_space, sphere
from mathnavi.models.manifold.manifold import CutLocusError, Manifold
from mathnavi.models.mechanism.entity import build_model, mechanism_digest
from mathnavi.models.mechanism.geometry import MechanismManifold
from mathnavi.models.mechanism.system import heavier
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.renders.logged_run import LoggedRun
from mathnavi.sim.metrics.lagrangian import VelocityErrors
from mathnavi.sim.records.log_arrays import CRAMER_RAO
from mathnavi.sim.records.missions import MechanismRecord, SpaceRecord, read_mission
from mathnavi.sim.records.run_folder import RunLog, last_at, read_log

REACH = 0.5  # [rad, m] that an error of the position, the largest or a usual one, is drawn as, at most
USUAL = 0.9  # share of the errors of a mechanism that are not larger than that
MOST_EXAMINED = 2000  # estimates that are examined for that
SPACES: dict[str, Manifold] = {"body": Attitude(), "sphere": sphere(3), "hyperbolic-plane": hyperbolic_space(2)}


@dataclass(frozen=True, eq=False)
class LagrangianRun(LoggedRun):
    """The run of one system; x is a point, v a velocity of its manifold."""

    manifold: Manifold
    space: str | None  # of SPACES; None for a mechanism
    mechanism: str | None  # what MuJoCo moved, as ``build_spec`` takes it; None for a point
    states: tuple[str, ...]  # (nx,) with units
    inputs: tuple[str, ...]
    tolerance: float  # of the velocity [rad/s, m/s, 1/s]
    t_estimate: Array  # (m,) [s]
    estimate: Array  # (m, nx)
    innovation: Array | None  # (m,) distance between a reading and its prediction; NaN before the first
    has_tuned_bandwidths: bool  # whether the observer's follow the innovations

    @property
    def diverged(self) -> bool:
        """True if the run ended early, because the state was no longer finite."""
        asked = self.log.config.get("fields", {}).get("duration")
        return isinstance(asked, int | float) and self.duration < asked - TIME_TOLERANCE

    @property
    def is_ball(self) -> bool:
        """True for a body on a ball joint, whose velocity is its rate of turning."""
        return self.mechanism == "rigid-body" and self.space is not None

    @cached_property
    def truth(self) -> Array:
        """(m, nx) the true states at the times of the estimates."""
        states: Array = self.log.x[np.searchsorted(self.t, self.t_estimate - TIME_TOLERANCE)]
        return states

    @cached_property
    def errors(self) -> VelocityErrors:
        """Errors of all estimates."""
        initialised = np.array([self.log.status(float(t)) is not Status.INITIALISING for t in self.t_estimate])
        return VelocityErrors.between(
            self.t_estimate, self.truth, self.estimate, initialised.astype(np.float64), self.manifold
        )

    @cached_property
    def velocity_error(self) -> Array:
        """(m,) norm of the components of the velocity error, in their units."""
        lengths: Array = np.linalg.norm(self.errors.components, axis=1)
        return lengths

    @cached_property
    def velocity(self) -> tuple[Array, Array]:
        """(m, nv) true and estimated, the latter moved to where the system is; NaN where there is no one way there."""
        n, manifold = self.manifold.size, self.manifold
        v = self.truth[:, n:]
        error = [
            manifold.vector(x[:n], c) if np.isfinite(c).all() else np.full(manifold.vector_size, np.nan)
            for x, c in zip(self.truth, self.errors.components, strict=True)
        ]
        return v, v - np.array(error)

    @cached_property
    def least_deviation(self) -> Array | None:
        """Cramér-Rao bound (m,) of the length of the velocity error at the estimates; None if not known."""
        bound = self.log.arrays.get(CRAMER_RAO)
        n = self.manifold.dimension
        if bound is None or bound.shape[1] != 2 * n:
            return None
        least: Array = np.linalg.norm(bound[np.searchsorted(self.t, self.t_estimate - TIME_TOLERANCE), n:], axis=1)
        return least

    @property
    def velocity_names(self) -> tuple[str, ...]:
        """(nv,) with units."""
        return self.states[self.manifold.size :]

    @property
    def unit(self) -> str:
        """Unit of velocities; of a mechanism with joints of two kinds, both."""
        units = dict.fromkeys(name.partition("[")[2].rstrip("]") for name in self.velocity_names)
        return ", ".join(units)

    @property
    def has_begun_wrong(self) -> bool:
        """True if the first estimate of the velocity had a larger error than is allowed."""
        return bool(self.velocity_error[0] > self.tolerance)

    @property
    def found_from(self) -> float | None:
        """[s] from when on the velocity is known to one percent of that at the start; None where that is at rest."""
        found = self.log.summary.get("found_from_s")
        return None if found is None else float(found)

    @cached_property
    def lyapunov_gain(self) -> float | None:
        """B of V and W; None for an estimator that is not the observer (D.6), or has a bandwidth for each joint."""
        fields = self.log.config.get("estimator", {}).get("fields", {})
        if not {"bandwidth", "gains"} <= set(fields) or self.has_tuned_bandwidths:
            return None
        return IntrinsicGains(float(fields["bandwidth"] or DEFAULT_BANDWIDTH), law=fields["gains"]).velocity()

    @cached_property
    def magnification(self) -> float:
        """Factor by which errors of the position are drawn larger than they are: 1, 2, 5, 10 and so on."""
        examined = np.unique(np.linspace(0, len(self.t_estimate) - 1, MOST_EXAMINED).astype(int))
        sizes = [float(np.abs(c).max()) for k in examined if self.errors.found[k] and (c := self.apart(k)) is not None]
        # Of a mechanism found at rest even the largest error is small, and most are much smaller than that.
        share = USUAL if self.space is None and not self.has_begun_wrong else 1.0
        largest = float(np.quantile(sizes, share)) if sizes else 0.0
        if not 0.0 < largest < REACH:
            return 1.0
        power = 10.0 ** math.floor(math.log10(REACH / largest))
        return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= REACH / largest)

    def belief(self, t: float) -> int:
        """Return the index of the newest estimate at ``t`` [s]; -1 without one, or if it has found nothing yet."""
        k = last_at(self.t_estimate, t)
        return k if k >= 0 and self.errors.found[k] > 0.0 else -1

    def position(self, t: float) -> Array:
        """(size,) at ``t`` [s]."""
        x: Array = self.log.x[self.index(t), : self.manifold.size]
        return x

    def apart(self, k: int) -> Array | None:
        """Return the coordinates (n,) of estimate k about the truth; None if they are not defined."""
        n = self.manifold.size
        try:
            return self.manifold.coordinates(self.truth[k, :n], self.estimate[k, :n])
        except CutLocusError:
            return None

    def drawn(self, k: int) -> Array:
        """(size,) where estimate k is drawn: off by ``magnification`` times its error."""
        return self.towards(k, 1.0)

    def towards(self, k: int, share: float) -> Array:
        """(size,) a share of the way from the truth to where estimate k is drawn, in the chart about the truth."""
        n, apart = self.manifold.size, self.apart(k)
        if apart is None:
            end: Array = self.estimate[k, :n] if share > 0.5 else self.truth[k, :n]
            return end
        point: Array = self.manifold.point(self.truth[k, :n], share * self.magnification * apart)
        return point

    def reference(self, t: float) -> Array | None:
        """(size,) where a body should be at ``t`` [s]; None where nothing asks for it."""
        k = last_at(self.log.adopted, t)
        if "attitude_rms_rad" not in self.log.summary or k < 0:
            return None
        plan = self.log.plans[k]
        x: Array = plan.x[max(last_at(plan.t, t), 0), : self.manifold.size]
        return x


def load_run(directory: str | Path) -> LagrangianRun:
    """Read a run's folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    log = read_log(directory, may_diverge=True)
    try:
        return _described(log, log.config["mission"], log.arrays)
    except RunFolderError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(
            f"{str(log.directory)!r} does not hold the run of a Lagrangian system: {error!r}"
        ) from None


def _check_file(log: RunLog, mechanism: str) -> None:
    """Raise RunFolderError for a mechanism whose files have changed since it was run."""
    recorded, now = log.config.get("inputs", {}).get("mechanism"), mechanism_digest(mechanism)
    if recorded is not None and recorded != now:
        raise RunFolderError(
            f"mechanism {mechanism!r} is no longer the one that run {str(log.directory)!r} moved: its digest is {now}, "
            f"the run's {recorded}; allowed: the unchanged file"
        )


def _described(log: RunLog, mission: Mapping[str, Any], arrays: Mapping[str, Array]) -> LagrangianRun:
    record: MechanismRecord | SpaceRecord
    if mission.get("space") is None:
        record, space = read_mission(MechanismRecord, mission), None
        mechanism: str | None = record.mechanism
        _check_file(log, record.mechanism)
        model = heavier(build_model(record.mechanism), float(log.config["fields"]["load"]))
        manifold: Manifold = MechanismManifold(model)
    else:
        record = read_mission(SpaceRecord, mission)
        space = record.space
        manifold, mechanism = SPACES[space], "rigid-body" if space == "body" else None
    states = record.states
    seen = arrays["estimate.t"] <= log.t[-1] + TIME_TOLERANCE
    t, x = arrays["estimate.t"][seen], arrays["estimate.x"][seen]
    size = manifold.size + manifold.vector_size
    if not (len(states) == log.x.shape[1] == size and x.shape == (len(t), size) and len(t)):
        raise RunFolderError(
            f"{str(log.directory)!r}: estimate.x {x.shape} and truth.x {log.x.shape} are not of the {size} states "
            f"{states}"
        )
    innovation = arrays["estimate.innovation"][seen, 0] if "estimate.innovation" in arrays else None
    return LagrangianRun(
        log,
        manifold,
        space,
        mechanism,
        states,
        record.inputs,
        record.tolerance,
        t,
        x,
        innovation,
        "estimate.bandwidth" in arrays,
    )
