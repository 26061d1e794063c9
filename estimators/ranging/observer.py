"""The active observer of Paper C, (C.5), with a feed-forward, without which it would lag.

    z' = feed-forward - k_V [dV_rho / dz]' - k_Q [dQ / dz]' Q,   x_hat = Phi(z),   z = (s_1, ..., s_l, phi),

with V_rho and Q of ``observer_kernels``. It is stiff, so a period dt is one linearly implicit step, z + feed-forward -
dt (I + dt H)^-1 gradient. (C.5) as printed has no feed-forward and so does not stay on the truth;
``feedforward_kernels`` has three that do. Phi is the thesis' vector average: the mean of the positions that the rays
imply. Range rates come from a window of readings, at the centre of which the observer runs; from there the estimate is
pushed forward with the inputs that odometry measured. A lost ray is replaced by that motion too.

The covariance of the estimate is that of the errors of these gains (``observer_covariance``). Where fitted ranges and
rates are beyond four of their deviations about those expected at the pose for more than 0.25 s, the estimate is
DEGRADED until 2 s without, and LOST after 2 s of it, until 5 s without. Where it was told no start, or was lost, it is
DEGRADED until an estimator that finds a pose itself has found the same (``unique_pose``). A ray with noise that repeats
itself while the robot moves is left out.

**Ranges and range rates from noisy ranges**: a Savitzky-Golay filter at the centre of a window.

The output flow Q needs rho_dot. From noisy ranges, which differ by 0.1 m from one to the next, no causal filter
estimates it well enough; the polynomial of order p that fits the 2 m + 1 readings around an instant best does, m
periods later. The observer therefore runs at the window's centre, and its estimate is propagated from there with the
inputs since.

The fit is to the ranges themselves, or to the innovation: their difference from the ranges expected of a robot that
moves through the window by the inputs. Within a second ranges are not a cubic of time; the innovation on the truth is
zero, so a straight line fits it, and an estimate on the truth stays on it for any window.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval
from scipy.interpolate import CubicSpline

from mathnavi.estimators.integrity.repeats import STUCK, Repeats
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.ranging.feedforward_kernels import forward_manifold, forward_rho_dot, forward_s, stay
from mathnavi.estimators.ranging.model import FROM_WHERE, RangeModel
from mathnavi.estimators.ranging.observer_covariance import ObserverCovariance, Step, innovations, slopes_of
from mathnavi.estimators.ranging.observer_kernels import anchored, kept_within, observed, pushed_forward, seen_from
from mathnavi.estimators.ranging.range_rate_kernels import innovated, measured
from mathnavi.estimators.ranging.reader import RangeReader
from mathnavi.estimators.ranging.unique_pose import UniquePose
from mathnavi.estimators.timeout_monitor import waiting, worst
from mathnavi.interfaces.bounds import FINITE_NUMBERS, Positive, Within, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import NumberList
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.field.curve import smooth
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality

LONGEST_WINDOW = 1001
HIGHEST_ORDER = 7
_STRIDE = 5  # readings at most between two at which rays are cast
_LEAST_NODES = 4  # of them on either side
_DOUBTED = 0.25  # [s] of a disagreement after which an estimate is no longer OK
_SETTLED = 2.0  # [s] without a disagreement until an estimate is OK again, or with one until it is lost
_FOUND = 5.0  # [s] without one until an estimate that was lost is OK again
_DEVIATIONS, _APART = 3.0, 0.02  # of a range, and share of the longest: positions by two rays that agree
_MOVED = 3.0  # deviations of a range by which the expected one changes while a ray that is stuck does not
_DISAGREEING = 4.0  # deviations of one of the fitted ranges and rates, which are many

_WORDS = {
    Status.DEGRADED: "may be at another pose with which its ranges agree",
    Status.LOST: "is at another pose than the one that its readings are found to be of",
}


def check_window(window: int, order: int) -> None:
    """Raise FieldError unless the window is an odd number of readings, and more than the polynomial needs."""
    if not (window % 2 == 1 and 3 <= window <= LONGEST_WINDOW):
        raise FieldError(f"window = {window!r}; allowed: an odd number of readings from 3 to {LONGEST_WINDOW}")
    if not 1 <= order <= min(HIGHEST_ORDER, window - 1):
        highest = min(HIGHEST_ORDER, window - 1)
        raise FieldError(f"order = {order!r}; allowed with window = {window}: 1 to {highest}")


@lru_cache(maxsize=16)
def savitzky_golay(window: int, order: int) -> Array:
    """Weights (p + 1, 2 m + 1) from readings at tau = -1, ..., 1 to the coefficients of the polynomial that fits them
    best.
    """
    tau = np.linspace(-1.0, 1.0, window)
    weights: Array = np.ascontiguousarray(np.linalg.pinv(np.vander(tau, order + 1, increasing=True)))
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=16)
def spread(window: int) -> Array:
    """Matrix (2 m + 1, 2 k + 1) of a cubic spline: from values at 2 k + 1 readings, evenly spaced from end to end, to
    values at all readings.
    """
    m = window // 2
    stride = max(step for step in range(1, _STRIDE + 1) if step == 1 or (m % step == 0 and m >= _LEAST_NODES * step))
    at = np.arange(-m, m + 1, stride)
    weights: Array = np.ascontiguousarray(CubicSpline(at, np.eye(len(at)))(np.arange(-m, m + 1)))
    weights.flags.writeable = False
    return weights


class FitWindow:
    """Window of the last 2 m + 1 readings of ranges, and the inputs between them."""

    def __init__(self, window: int, sensors: int) -> None:
        self.ranges = np.full((window, sensors), np.nan)  # (2 m + 1, l) [m], the oldest first
        self.inputs = np.zeros((window - 1, 2))  # (2 m, 2) [m/s, rad/s]
        self.count = 0  # readings so far
        self.half = window // 2  # m

    def push(self, rho: Array, u: Array) -> None:
        """Add a reading rho (l,) [m], NaN where a ray was lost, and the input u (2,) since the one before."""
        self.ranges[:-1], self.ranges[-1] = self.ranges[1:], rho
        self.inputs[:-1], self.inputs[-1] = self.inputs[1:], u
        self.count += 1

    @property
    def has_centre(self) -> bool:
        """True if there is a reading at the centre."""
        return self.count > self.half

    @property
    def is_at_start(self) -> bool:
        """True if the reading at the centre is the first."""
        return self.count == self.half + 1

    @property
    def inputs_since(self) -> Array:
        """Inputs (n, 2) from the centre, or from the first reading while there is none at the centre, until now."""
        return self.inputs[len(self.inputs) - min(self.count - 1, self.half) :]

    @property
    def centre_input(self) -> Array:
        """Mean (2,) of the inputs before and after the centre, between which it jumps."""
        mean: Array = 0.5 * (self.inputs[self.half - 1] + self.inputs[self.half])
        return mean


FeedForward = Literal["none", "s", "rho_dot", "manifold"]
Fitted = Literal["innovation", "ranges"]

FEED_FORWARDS: Mapping[FeedForward, Callable[..., Array]] = {
    "none": stay,
    "s": forward_s,
    "rho_dot": forward_rho_dot,
    "manifold": forward_manifold,
}

_LARGEST_GAIN = 1e6
Gain = Annotated[
    float, Within(Interval(ge=0.0, le=_LARGEST_GAIN), allowed=f"a finite value from 0 to {_LARGEST_GAIN:g}")
]


@configuration
class RangeObserverConfig:
    """Fields of the command line."""

    feedforward: FeedForward = "s"
    """feed-forward of z: none (as printed), s, rho_dot or manifold"""
    k_v: Gain = 1.0
    """gain k_V of V_rho [1/(m^2 s)]"""
    k_q: Gain = 1.0
    """gain k_Q of |Q|^2 / 2 [s/m^4]"""
    fitted: Fitted | None = None
    """data that range rates are fitted to; if not given, the ranges with feedforward none, otherwise the innovation"""
    window: int | None = None
    """number of readings in a fit; 101, or 3 if the mission declares exact ranges, if not given"""
    order: int | None = None
    """order of the fitted polynomial; 1 for the innovation and 3, or 2 with a window of 3, for ranges, if not given"""
    z_0: Annotated[NumberList, FINITE_NUMBERS] = ()
    """initial observer state S_1 ... S_L PHI [rad]; that of the mission's start if not given"""
    timeout: Positive = 0.5
    """time without a range after which the estimate is lost [s]"""

    def __post_init__(self) -> None:
        for exact in (False, True):
            check_window(*self.fit(exact))

    @property
    def fits_innovation(self) -> bool:
        """True if range rates are fitted to the innovation, False if they are fitted to the ranges."""
        return (self.fitted or ("ranges" if self.feedforward == "none" else "innovation")) == "innovation"

    def fit(self, exact: bool) -> tuple[int, int]:
        """Window and order of the fit, for a mission whose ranges are exact or not."""
        fewest = (1 if self.order is None else self.order) // 2 * 2 + 3  # odd, and more than the order
        window = (fewest if exact else 101) if self.window is None else self.window
        return window, (1 if self.fits_innovation else min(3, window - 1)) if self.order is None else self.order


class RangeObserver:
    """Estimator of the pose from ranges and odometry: the observer of Paper C."""

    Config = RangeObserverConfig

    def __init__(self, config: RangeObserverConfig, mission: RangingMission) -> None:
        exact = mission.ranging.relative == mission.ranging.absolute == 0.0
        window, order = config.fit(exact)
        curve = smooth(
            mission.curve, "range_observer", "Proposition C.2 bounds the curvature of theta, of which a corner has none"
        )
        l = mission.sensors  # noqa: E741
        if config.z_0 and len(config.z_0) != l + 1:
            raise FieldError(f"z_0 = {config.z_0!r}; allowed with {l} sensors: {l + 1} numbers")
        self.period = mission.period
        # A gap leaves the window at its end only, and the observer runs at the centre.
        settling = max(config.timeout, window * mission.period)
        self._reader, self._gains = RangeReader(mission, config.timeout, settling), (config.k_v, config.k_q)
        sigma = math.hypot(mission.ranging.absolute, mission.ranging.relative * self._reader.longest)
        self._agreeing = l * l * (_DEVIATIONS**2 * sigma**2 + (_APART * self._reader.longest) ** 2)  # [m^2] of V_rho
        self._advance, self._fits_innovation = FEED_FORWARDS[config.feedforward], config.fits_innovation
        # Before there is a range rate, the expectation uses none.
        self._foresee = forward_s if config.feedforward == "rho_dot" else self._advance
        self._noisy, self._repeats = not exact, [Repeats() for _ in range(l)]
        self._begun, self._moved = np.full(l, np.nan), _MOVED * sigma  # [m] expected when repetitions began, and since
        self._wall, self._alpha = curve.wall, mission.alpha
        self._fit = (savitzky_golay(window, order), spread(window), mission.period)
        self._window = FitWindow(window, l)
        x, y, phi = mission.start_pose
        self._pose = np.array([*kept_within(self._wall, x, y), phi])  # (3,) at the window's centre, or at the start
        self._z = seen_from(self._wall, self._alpha, self._pose, np.zeros(l + 1))  # (l + 1,) likewise
        if config.z_0:
            self._z[:] = config.z_0
        model = RangeModel(mission)
        self._rays = (mission.alpha, model.relative, model.absolute)
        self._odometry = (model.W, model.scale**2)  # variances (2,) of the input, and that of its scale error
        self._last: tuple[Array, Array] | None = None  # pose (3,) and covariance (3, 3) of the last call
        self._innovations = np.full((2, l), np.nan)  # [m] of the last call, and their deviations
        self._errors = ObserverCovariance(model, self._fit[0], mission.period, reckoned=self._fits_innovation)
        self._quiet, self._wrong = math.inf, 0.0  # [s] for which the ranges have agreed with the pose, and have not
        self._was_lost, self._unique = False, UniquePose(mission)  # since it was OK last; whether it is the only pose
        self._errors.start(
            slopes_of(self._wall, self._alpha, self._pose, self._z), RangeModel(mission).start()[1][:3, :3]
        )
        self._readings = np.full((3, l), np.nan)  # at the centre: rho, rho_dot, and which readings were left out
        self._ones = np.ones(l)
        self._value = np.zeros(2)  # V_rho and |Q|^2 / 2

    @staticmethod
    def build(config: RangeObserverConfig, mission: RangingMission) -> RangeObserver:
        """Build the estimator of one run.

        Raises FieldError for a ``z_0`` whose length does not fit the mission's sensors, MissionError for a polygon or a
        map that may be off.
        """
        mission.check_exact("range_observer")
        return RangeObserver(config, mission)

    @staticmethod
    def properties(config: RangeObserverConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        printed, corrected = config.feedforward == "none", min(config.k_v, config.k_q) > 0.0
        converges = corrected and not printed
        behind = "without a feed-forward it lags behind a moving robot"
        return ObserverProperties(
            domain_of_attraction=Domain.LOCAL if converges else Domain.NONE,
            rate=Rate.EXPONENTIAL if converges else Rate.NONE,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.GLOBAL,
            system_domain=Domain.GLOBAL,
            stays_on_truth=not printed,
            note=behind if printed else FROM_WHERE if converges else "",
        )

    @staticmethod
    def sensors(config: RangeObserverConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: RangeObserverConfig, mission: RangingMission) -> RangeQuality:
        """Declared quality of the ranges."""
        return mission.ranging

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]; ``command`` (2,) replaces missing odometry.

        ``extra`` has z (l + 1,) at ``t``, and V_rho and |Q|^2 / 2 (2,) at the window's centre, where the observer runs.
        ``innovations`` (l,) [m] and ``innovation_std`` (l,) [m] are those of the rays (``interfaces.innovations``), as
        predicted from the estimate of the call before, with its covariance, over a period. It also counts the readings
        that were not used, by ray; an outlier once it is at the centre.
        """
        window, reader = self._window, self._reader
        rho, u = reader.read(t, measurements, command)
        self._innovations[:] = np.nan
        if self._last is not None:
            odometry = (np.ascontiguousarray(u), *self._odometry)
            innovations(self._wall, self._rays, rho, *self._last, odometry, self.period, self._innovations)
        stuck = self._stuck(rho)
        if stuck.any():
            rho, self._innovations[:, stuck] = np.where(stuck, np.nan, rho), np.nan
            reader.counts.add(Unused.OUTLIER, int(np.count_nonzero(stuck)))
        window.push(rho, u)
        if window.has_centre:
            self._observe()
            reader.counts.add(Unused.OUTLIER, int(self._readings[2].dot(self._ones)))
        reader.note(t, reader.converged or bool(self._value[0] <= self._agreeing))
        P = self._errors.now(self._pose, window.inputs_since)
        status = worst(reader.status(t), self._lock) if window.has_centre else Status.INITIALISING
        z, x = pushed_forward(self._wall, self._alpha, self._z, self._pose, window.inputs_since, self.period)
        self._last = x, P
        extra = {"z": z, "value": self._value.copy(), **published(self._innovations), **reader.counts.extra}
        measured = bool(np.isfinite(rho).any())
        alone = self._unique.judge(Estimate(t, x, P, status), measurements, command, measured=measured)
        wanted = "ranges" if window.has_centre else f"{window.half + 1} readings: it has {window.count}"
        message = "" if self._lock is Status.OK else "disagrees with its ranges and their rates"
        if alone is not Status.OK and status.usable:
            status, message = worst(status, alone), message or _WORDS[alone]
        return Estimate(t, x, P, status, extra, waiting(status, wanted) or message or reader.message)

    def _stuck(self, rho: Array) -> Flags:
        """True (l,) for rays with noise whose ranges rho (l,) [m] repeat themselves while those expected change."""
        if not self._noisy:
            return np.zeros(len(rho), np.bool_)
        expected = rho - self._innovations[0]
        count = np.array([same.take(each) for same, each in zip(self._repeats, rho[:, np.newaxis], strict=True)])
        self._begun = np.where((count == 0) | np.isnan(self._begun), expected, self._begun)
        stuck: Flags = (count >= STUCK) & (np.abs(expected - self._begun) > self._moved)
        return stuck

    @property
    def _lock(self) -> Status:
        """Status that follows from how long ranges and rates have agreed or disagreed with the pose."""
        if self._wrong > _SETTLED:
            return Status.LOST
        return Status.OK if self._quiet > (_FOUND if self._was_lost else _SETTLED) else Status.DEGRADED

    def _observe(self) -> None:
        """Advance the observer by one period, at the window's centre."""
        wall, alpha, window = self._wall, self._alpha, self._window
        u, begins = window.inputs[window.half - 1], window.is_at_start
        predicted = self._pose if begins else integrate(self._pose, u[0], u[1], self.period)

        def forward(by: Callable[..., Array], there: Array) -> Array:
            z: Array = self._z if begins else by(wall, alpha, self._z, self._readings, there, u, self.period)
            return z

        if self._fits_innovation:
            raw = np.stack([window.ranges[window.half], self._readings[1], self._readings[2]])
            foreseen = anchored(wall, alpha, forward(self._foresee, raw), raw[0], predicted)
            readings = innovated(window.ranges, window.inputs, window.centre_input, self._fit, wall, alpha, foreseen)
        else:
            readings = measured(window.ranges, self._fit[0], self.period)
        if not begins:
            filled = np.isfinite(window.ranges).mean(axis=0)
            self._errors.step(self._stepped(readings, u), self._z, self._pose, readings[:2], filled, u)
        z = forward(self._advance, readings)
        self._z, self._pose, self._value = observed(
            wall, alpha, z, predicted, readings, window.centre_input, self._gains, self.period
        )
        self._readings = readings
        disagreement = self._errors.disagreement(wall, self._pose, readings, window.centre_input)
        if disagreement <= _DISAGREEING:
            self._quiet, self._wrong = self._quiet + self.period, 0.0
            self._was_lost &= self._quiet <= _FOUND
            return
        self._wrong += self.period
        self._was_lost |= self._wrong > _SETTLED
        if self._wrong > _DOUBTED:
            self._quiet = 0.0

    def _stepped(self, readings: Array, u: Array) -> Step:
        """One step to these ``readings`` (3, l) under u (2,), with errors that the caller chooses."""
        wall, alpha, period, here = self._wall, self._alpha, self.period, self._readings
        centre, gains = self._window.centre_input, self._gains

        def step(z: Array, pose: Array, n: Array, rates: Array, du: Array, exact: bool) -> tuple[Array, Array]:
            errors = np.stack([n, rates, np.zeros(len(n))])
            before, after, held = here + errors, readings + errors, u + du
            predicted = integrate(anchored(wall, alpha, z, before[0], pose), held[0], held[1], period)
            advance = forward_manifold if exact else self._advance
            moved = advance(wall, alpha, z, before, after, held, period)
            z, x, _ = observed(wall, alpha, moved.copy(), predicted, after, centre + du, gains, period)
            return z, x

        return step
