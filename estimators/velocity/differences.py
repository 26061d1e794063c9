"""The law of ``filtered_differences``: the velocity without a model, from differences of readings.

    w_k = (y_k - y_{k-1}) / h,        v = Butterworth's low-pass of second order of w,

where y_k - y_{k-1} are the coordinates of y_k about y_{k-1}. If readings are missing, h is the whole time between those
that were read, and the filter gets w once for each of its periods. It filters the components of the vector as stored:
ambient ones on a curved space, since those in a frame would jump with the frame; v is their tangent part. The position
is the newest reading, extrapolated with v, at most over the time after which the estimate is lost.

The filter lags. Passed through it once more, v lags as much again, and the difference is the declared error, in
addition to the noise of the readings: their variance times sum g_k^2, g being the response of v to one reading.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import butter, sosfilt

from mathnavi.estimators.velocity.gain_covariance import Residual
from mathnavi.estimators.velocity.readings import OutlierCounter, SpeedGate, innovation, reading_variance
from mathnavi.interfaces.signals import NOTHING, Array
from mathnavi.models.manifold.mission import LagrangianMission

_ORDER = 2
_RESPONSE = 2000  # readings after which it is over


class Differences:
    """A ``VelocityLaw``."""

    extra: Mapping[str, Array] = NOTHING
    state_covariance: Array | None = None
    doubt = ""
    settling = 0.0  # beyond a filter that is faster than any timeout

    def __init__(self, cutoff: float, timeout: float, mission: LagrangianMission) -> None:
        """``cutoff`` [Hz] is that of the filter, 0 for none; ``timeout`` is the longest time of extrapolation [s]."""
        self._mission, self._manifold = mission, mission.system.manifold
        self._timeout = timeout
        self._variance: Array | None = None  # (n,) of a reading, if it is not the declared one
        sos = butter(_ORDER, cutoff, output="sos", fs=1.0 / mission.period) if cutoff else None
        self._section: list[float] | None = None if sos is None else sos[0].tolist()
        response = np.array([1.0, -1.0, *np.zeros(_RESPONSE)]) / mission.period
        response = response if sos is None else sosfilt(sos, response)
        self._amplified = float(response @ response)  # [1/s^2]
        self.residual: Residual | None = None

    @property
    def state(self) -> Array:
        """State (size + vector_size,) (x, v)."""
        return self.after(self._age)

    def after(self, age: float) -> Array:
        """State (size + vector_size,) an ``age`` [s] after the newest reading."""
        manifold = self._manifold
        w = manifold.components(self._y, self._w)
        x = manifold.point(self._y, min(age, self._timeout) * w) if age else self._y
        return np.concatenate([x, manifold.vector(x, manifold.components(x, self._w))])

    @property
    def deviation(self) -> Array:
        """Standard deviations (2 n,) of position and velocity: of the noise, and of what the filter lags by."""
        variance = self._assumed
        lag = self._manifold.components(self._y, self._w - self._lagging) if self._section is not None else 0.0
        return np.concatenate([np.sqrt(variance), np.sqrt(self._amplified * variance + np.square(lag))])

    def start(self, y: Array) -> None:
        """Start at the point y (size,) with v = 0."""
        self._y, self._age = y, 0.0  # [s] since the newest reading
        self._w = np.zeros(self._manifold.vector_size)
        self._memory = np.zeros((2, 2, self._manifold.vector_size))  # of the filter, and of it once more
        self._lagging = self._w
        self._gate, self._outlier_counter = SpeedGate(self._mission, y, self._variance), OutlierCounter()
        self._assumed = reading_variance(self._mission, y) if self._variance is None else self._variance

    def learn(self, variance: Array, steps: Array) -> None:
        """Assume these errors of a reading from now on."""
        self._variance = self._assumed = variance
        self._gate.learn(variance)

    def predict(self, h: float, u: Array, y: Array | None) -> None:
        """Let h [s] pass under an input u (nu,)."""
        self._age += h

    def correct(self, y: Array, h: float) -> bool:
        """Take a reading y (size,), h [s] after the last that was used; True if it was used."""
        moved = innovation(self._manifold, self._y, y)
        good = moved is not None and self._gate.passes(moved, h)
        if not self._outlier_counter.admits(good):
            return False
        if moved is None or not good or h > self._timeout:  # a difference over a longer time says nothing about v
            self.start(y)
            return True
        self._w = self._filtered(self._manifold.vector(self._y, moved / h), max(1, round(h / self._mission.period)))
        self._y, self._age = y, 0.0
        return True

    def _filtered(self, w: Array, periods: int) -> Array:
        """Output of the filter after ``periods`` periods with the difference w (vector_size,)."""
        if self._section is None:
            return w
        once = w
        for _ in range(periods):
            once = _section(self._section, self._memory[0], w)
            self._lagging = _section(self._section, self._memory[1], once)
        return once


def _section(coefficients: list[float], z: Array, w: Array) -> Array:
    """Output (n,) of a section of second order for an input w (n,); it updates its memory z (2, n).

    It is ``sosfilt`` of one sample, number for number, without what that takes to begin.
    """
    b0, b1, b2, _, a1, a2 = coefficients
    out: Array = b0 * w + z[0]
    z[0] = b1 * w - a1 * out + z[1]
    z[1] = b2 * w - a2 * out
    return out
