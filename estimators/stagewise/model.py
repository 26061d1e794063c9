"""Interface of a system with noise for estimators over many stages: transitions, readings and errors of its state.

    x_{k+1} = f(x_k, u_k) + w_k,   w_k ~ N(0, Q_k),        y_k = h(x_k) + v_k,   v_k ~ N(0, R_k).

A state x is a flat array, and may be a point of a manifold; its error e (d,) is added by ``sum``. A reading is
whitened, and linear to first order in e:

    R^{-1/2} (y - h(x + e)) = r - W e.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from mathnavi.estimators.timeout_monitor import is_late
from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.tolerances import TIME_TOLERANCE

Piece = tuple[float, Array]
"""duration [s], and the input (nu,) that is held for it"""


class Reader(Protocol):
    """Reader of a system's measurements: the inputs of its stages, and the usable readings."""

    def inputs(self, begin: float, end: float, measurements: Sequence[Measurement], command: Array) -> Sequence[Piece]:
        """Inputs that act in sequence from ``begin`` to ``end`` [s]; ``command`` (nu,) was held."""
        ...

    def reading(self, measurement: Measurement) -> Array | None:
        """Usable components (m,) of a measurement, NaN for lost ones; None if it has none."""
        ...


class StagewiseModel(Reader, Protocol):
    """System with noise."""

    size: int
    """number d of components of an error"""
    rows: int
    """largest number of components in the readings of one stage"""

    def start(self, reading: Array | None) -> tuple[Array, Array] | None:
        """State and covariance (d, d) at the first stage, with or without a reading (m,); None to wait for one."""
        ...

    def transition(self, x: Array, u: Array, h: float) -> tuple[Array, Array, Array]:
        """State after h [s] with u (nu,) held, its Jacobian F (d, d), and the covariance Q (d, d) of the noise."""
        ...

    def residual(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Residual r (m,) and W (m, d) of a reading y (m,) at x; rows of NaN for missing components."""
        ...

    def sum(self, x: Array, e: Array) -> Array:
        """State x + e, of an error e (d,)."""
        ...

    def difference(self, other: Array, x: Array) -> Array:
        """Error e (d,) with x + e = other."""
        ...

    def limits(self, x: Array) -> tuple[Array, Array]:
        """Least and largest errors (d,) at x that the mission allows, infinite without a limit."""
        ...

    def extra(self, x: Array, P: Array) -> Mapping[str, Array]:
        """Further arrays of an ``Estimate`` at a state x (nx,) with the covariance P (d, d) of its errors."""
        ...

    def reported(self, x: Array, P: Array) -> tuple[Array, Array | None]:
        """State and covariance of an ``Estimate``, from a state and the covariance P (d, d) of its errors."""
        ...


@runtime_checkable
class AssociatingModel(Protocol):
    """System whose readings may each have come about in several ways."""

    is_ambiguous: bool
    """False in a mission in which there is one way only, so that the reading is used as it is"""

    def conditioned(self, x: Array, P: Array, y: Array) -> tuple[Array, Array]:
        """State and covariance (d, d) after a reading y (m,), with all its ways by their probabilities."""
        ...

    def associated(self, x: Array, P: Array, y: Array) -> Array:
        """A reading y (m,) with the way that is the most likely at x, of covariance P (d, d), as ``residual`` takes it;
        missing components where none is.
        """
        ...


class CountedModel(StagewiseModel, Protocol):
    """System with noise that says why it does not use a measurement."""

    def unused(self, measurement: Measurement) -> Unused | None:
        """Reason why a measurement is not used; None for one that is."""
        ...

    def noise(self, x: Array, y: Array) -> Array:
        """Standard deviations (rows,) of the noise of a reading y at x, in its units: those that ``residual`` is in."""
        ...

    def restart(self) -> bool:
        """Start at the next reading, wherever the vehicle has gone since the last; False if the model cannot."""
        ...


def refused(measurement: Measurement, sensor: str) -> Unused | None:
    """Reason why a measurement is not one of a ``sensor``; None for one that is."""
    if measurement.name != sensor:
        return Unused.UNKNOWN_SENSOR
    return None if np.isfinite(measurement.value).all() else Unused.NOT_FINITE


@dataclass(frozen=True, eq=False)
class SmootherStage:
    """Time with readings, and the inputs since the stage before."""

    t: float  # [s]
    inputs: tuple[Piece, ...]
    readings: tuple[Array, ...]


class StageBuilder:
    """Builder of stages from the calls of an estimator; a reading older than the last stage is not used."""

    def __init__(self, model: Reader) -> None:
        self._model = model
        self._t: float | None = None  # [s] of the last stage

    def is_late(self, t: float) -> bool:
        """True for a reading of t [s] that is older than the last stage."""
        return is_late(t, self._t)

    def restart(self) -> None:
        """Forget the last stage: no motion leads from it to the next one."""
        self._t = None

    def add(self, t: float, measurements: Sequence[Measurement], command: Array) -> list[SmootherStage]:
        """Stages of a call at t [s] with the readings since the last, ``command`` (nu,) held."""
        by_time: dict[float, list[Array]] = {}
        for measurement in measurements:
            values = self._model.reading(measurement)
            if values is not None and not self.is_late(measurement.t):
                at = t if abs(measurement.t - t) <= TIME_TOLERANCE else measurement.t
                by_time.setdefault(at, []).append(values)
        by_time.setdefault(t, [])
        stages = []
        for at in sorted(by_time):
            pieces: Sequence[Piece] = ()
            if self._t is not None and at > self._t + TIME_TOLERANCE:
                pieces = self._model.inputs(self._t, at, measurements, command)
            stages.append(SmootherStage(at, tuple(pieces), tuple(by_time[at])))
            self._t = at
        return stages


def advanced(model: StagewiseModel, x: Array, inputs: Sequence[Piece]) -> tuple[Array, Array, Array]:
    """State after all ``inputs``, with the Jacobian F (d, d) and the covariance Q (d, d) of all of them."""
    F, Q = np.eye(model.size), np.zeros((model.size, model.size))
    for h, u in inputs:
        x, F_h, Q_h = model.transition(x, u, h)
        F, Q = F_h @ F, F_h @ Q @ F_h.T + Q_h
    return x, F, Q


def residuals(model: StagewiseModel, x: Array, readings: Sequence[Array]) -> tuple[Array, Array]:
    """Residual r (m,) and W (m, d) of all ``readings`` at x, without missing components."""
    r, W = np.empty(0), np.empty((0, model.size))
    for y in readings:
        r_y, W_y = model.residual(x, y)
        known = np.isfinite(r_y) & np.isfinite(W_y).all(axis=1)
        r, W = np.concatenate([r, r_y[known]]), np.concatenate([W, W_y[known]])
    return r, W
