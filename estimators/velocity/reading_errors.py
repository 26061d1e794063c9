"""Errors of position readings, as the readings show them: steps of encoders, noise, and noise that was not declared.

A mission that declares neither noise nor resolution declares nothing: no encoder is exact. The errors are then found
while the observer runs. Of every joint

    step    Delta, of which all changes of the reading are multiples (Euclid's algorithm), over 32 changes, if they are
            not all alike, as those of an exact reading at a constant rate are;
    noise   sigma^2 = min(mean r^2 / c, mean L^2), c = 1 + sum w_i^2,

where r is the reading less the cubic through the four before it, with weights w_i (c = 70 for readings that are evenly
spaced), and L the innovation. A smooth motion and the errors of the model add to either; neither is smaller than the
noise. The variance is then the larger of sigma^2 and Delta^2 / 12. A joint that stands shows no step: its encoder is
taken to be as coarse as the coarsest of the others, of hinges or of slides if one of them has moved. All is known after
fifty readings, if each joint has changed ten times, or three times by the same, or has not changed for fifty readings.

What a mission declares is tested instead: the smaller of r / sqrt(c R) and L / sqrt(R), of every fifth reading, which
are independent, by the windowed tests of energy (``mathnavi.estimators.integrity.windows``). R is the variance of noise
plus the largest that rounding can have, Delta^2 / 4. Encoders that repeat themselves or leap are those of
``encoder_faults``.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mathnavi.estimators.integrity.smoothness import POINTS, cubic_weights
from mathnavi.estimators.integrity.windows import CLIP, Flags, Thresholds, Windows
from mathnavi.estimators.velocity.encoder_faults import EncoderErrors, EncoderFaults
from mathnavi.estimators.velocity.readings import innovation, reading_variance, rounding_steps
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.models.manifold.attitude import ambient
from mathnavi.models.manifold.manifold import quaternion_parts, turn_starts
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import SteppedSystem
from mathnavi.models.mechanism.geometry import MechanismManifold

_FEWEST, _BLOCKS = 50, 4  # readings from which noise is known, and numbers of as many of which the quietest counts
_MEMORY = 200.0  # readings of the means
_CLIP = 25.0  # times a mean, beyond which a square counts no more
_RELEARN = 1.2  # ratio of a variance to the one before from which an observer is told
_STILL = 1e-10  # [rad, m] of a change that is none
_LEAST = 1e-8  # [rad, m] of a step that matters
_MULTIPLE = 1e-3  # of a step, within which a change is a multiple of it
_FAR = 16.0  # steps, beyond which a change says nothing more about them
_CONFIRMED, _ALIKE, _BLOCK = (
    10,
    3,
    32,
)  # changes, and alike ones, by which a step is known; after which it is found anew
_WINDOWS = (0.5, 2.0)  # [s]


class EncoderSteps:
    """Steps of the encoders of k joints, found from their readings."""

    def __init__(self, joints: int) -> None:
        self._found = np.full(joints, np.inf)  # over the current block
        self._counted = np.zeros(joints)  # changes in it
        self._alike = np.zeros(joints)  # changes by one step in it
        self._varied = np.zeros(joints, dtype=np.bool_)  # whether they were by different multiples, 0 among them
        self._confirmed = np.full(joints, np.nan)  # of the last block that was whole
        self._still = np.full(joints, np.inf)  # readings since the last change

    @property
    def steps(self) -> Array:
        """Steps (k,) [rad, m]; 0 of a joint that has none, or has not moved."""
        within = np.where(self._varied, self._found, 0.0)
        return np.where(np.isnan(self._confirmed), within, self._confirmed)

    @property
    def known(self) -> Flags:
        """True (k,) for a joint that has not changed too seldom to say."""
        seen = ~np.isnan(self._confirmed) | (self._counted >= _CONFIRMED) | (self._alike >= _ALIKE)
        known: Flags = seen | (self._still >= _FEWEST)
        return known

    @property
    def standing(self) -> Flags:
        """True (k,) for a joint that has not changed since the beginning."""
        standing: Flags = np.isinf(self._still)
        return standing

    def read(self, changes: Array) -> None:
        """Take the changes (k,) of the joints from one reading to the next."""
        refine(
            np.abs(changes), self._found, self._counted, self._alike, self._varied, self._confirmed, self._still
        )  # fmt: skip


class ReadingErrors:
    """Variances and steps of the coordinates of a mission's readings, declared or found."""

    def __init__(self, mission: LagrangianMission) -> None:
        self._mission, self._system, self._manifold = mission, mission.system, mission.system.manifold
        n = self._manifold.dimension
        self.declared = mission.reading.noise > 0.0 or mission.reading.resolution > 0
        """whether the mission declares any"""
        manifold = self._manifold
        scalars = manifold.scalars if isinstance(manifold, MechanismManifold) else ()
        self._places = np.array([each.place for each in scalars], dtype=np.intp)
        self._coordinates = np.array([each.coordinate for each in scalars], dtype=np.intp)
        self._hinges = np.array([each.hinge for each in scalars], dtype=np.bool_)
        self._encoders = EncoderSteps(len(scalars))
        self._quaternions, turns = quaternion_parts(manifold), turn_starts(manifold)
        self._turns = np.zeros(3 * len(turns))  # sums (3 q,) [rad] of the turns from reading to reading
        rotations = [start + k for start in turns for k in range(3)]
        self._rotations = np.array(rotations, dtype=np.intp)
        self._watched = np.concatenate([self._coordinates, self._rotations])
        names = [f"the attitude about axis {axis}" for _ in turns for axis in "xyz"]
        self.faults = EncoderFaults([*(each.name for each in scalars), *names], mission.period)
        """encoders that repeat themselves or leap: of the k slides and hinges, and then three of each attitude"""
        self.joint_errors = np.zeros(len(scalars))
        """the larger of deviation and step (k,) [rad, m] of the encoders of slides and hinges; 0 while not known"""
        self._past: deque[tuple[float, Array]] = deque(maxlen=POINTS)  # (t, y), the newest last
        self._smooth, self._predicted = np.zeros(n), np.zeros(n)  # means of r^2 / c and of L^2
        self._squares, self._blocks = np.zeros(n), deque[Array](maxlen=_BLOCKS)  # sum and means of r^2 / c, by block
        self._count, self._innovations = 0, 0
        self._newest: Array | None = None  # (n,) r / sqrt(c) of the last reading
        self._was_known = False
        self.variance, self.steps = np.zeros(n), np.zeros(n)
        """variances (n,) [rad^2, m^2] and steps (n,) [rad, m] that were found; 0 where they are not known yet"""
        self._declared: tuple[Array, Array] | None = None  # variances without rounding, and steps (n,)
        self._tested: Array | None = None  # (n,) R
        self._windows: Windows | None = None
        self._used = np.ones(n, dtype=np.bool_)

    @property
    def known(self) -> bool:
        """True if the errors are declared, or if enough readings have shown them."""
        return self.declared or (self._count >= _FEWEST and bool(self._encoders.known.all()))

    @property
    def contradicted(self) -> bool:
        """True if the readings are noisier than declared."""
        return self._windows is not None and self._windows.worst(self._used).ratio > 1.0

    @property
    def doubt(self) -> str:
        """Message about assumed errors that are wrong; "" if they are as declared, or found."""
        if not self.known:
            return "does not know its readings' noise yet"
        return "has readings that are noisier than declared" if self.contradicted else ""

    def ignore(self, coordinates: slice) -> None:
        """Do not test these coordinates, which no encoder reads."""
        self._used[coordinates] = False

    def doubted(self, estimate: Estimate) -> Estimate:
        """Return an estimate unchanged, or DEGRADED if it is OK while the errors of its readings are not as declared,
        or not known, or while an encoder has failed.
        """
        doubt = (self.faults.doubt(estimate.t) or self.doubt) if estimate.status is Status.OK else ""
        return replace(estimate, status=Status.DEGRADED, message=doubt) if doubt else estimate

    def lose_turns(self, places: Sequence[int]) -> None:
        """The turns of hinges at these ``places`` of a point, and of no others, are not known."""
        self.faults.turned[: len(self._places)] = np.isin(self._places, places)

    def widened(self, covariance: Array, x: Array) -> Array:
        """Covariance (N, N) of a state x (N,) whose encoders have leapt, or lost their turns."""
        further = self.faults.deviation
        if not further.any():
            return covariance
        wider, scalars = covariance.copy(), len(self._places)
        wider[self._places, self._places] += np.square(further[:scalars])
        for part, s in zip(self._quaternions, further[scalars:].reshape(-1, 3), strict=True):
            slope = np.column_stack([ambient(x[part], axis) for axis in np.diag(s)])
            wider[part, part] += slope @ slope.T
        return wider

    def widened_deviation(self, deviation: Array) -> Array:
        """Deviations (2 n,) of positions and velocities, likewise."""
        further = self.faults.deviation
        if further.any():
            deviation[self._watched] = np.hypot(deviation[self._watched], further)
        return deviation

    def read(self, t: float, y: Array, predicted: Array | None) -> bool:
        """Take a reading y (size,) of t [s] and the position (size,) that was predicted for it, if it was.

        An estimator that predicts it later calls ``expect`` then. Returns True if ``variance`` and ``steps`` have
        changed, by as much as matters.
        """
        past = self._past
        moved = innovation(self._manifold, past[-1][1], y) if past and t > past[-1][0] else None
        if moved is not None:
            self._turns += moved[self._rotations]
        else:
            past.clear()
            self.faults.forget()
        if past:
            self._encoders.read(y[self._places] - past[-1][1][self._places])
        r = self._residual(t, y) if len(past) == POINTS else None
        past.append((t, y))
        self._newest = r
        if r is None:
            return False
        self._count += 1
        _mean(self._smooth, r, self._count)
        self._squares += np.square(r)
        if self._count % _FEWEST == 0:
            self._blocks.append(self._squares / _FEWEST)
            self._squares = np.zeros(len(r))
        off = None if predicted is None else innovation(self._manifold, predicted, y)
        self._watch(t, y, off)
        self._expect(y, off)
        if self.declared:
            return False
        due = self._count % _FEWEST == 0 or (self.known and not self._was_known)
        self._was_known = self.known
        return due and self._learn()

    def _watch(self, t: float, y: Array, off: Array | None) -> None:
        """Watch for encoders that repeat themselves or leap, once the errors of the readings are known.

        ``off`` (n,) is what the reading is off from its prediction, if it has one.
        """
        if not len(self._watched) or not self.known or self._count < _FEWEST:
            return
        if self.declared:
            if self._declared is None:
                steps = rounding_steps(self._mission, y)
                noise = reading_variance(self._mission, y) - np.square(steps) / 12.0
                self._declared = np.maximum(noise, 0.0), steps
            noise, steps = self._declared
        else:
            noise, steps = np.zeros(len(self.variance)), self.steps
        at, scalars, used = self._watched, len(self._places), self._used[self._watched]
        steps, noise, shown = steps[at], used * noise[at], self._smooth[at]
        steps[:scalars] = np.maximum(steps[:scalars], self._encoders.steps)
        self.joint_errors = np.maximum(np.sqrt(np.maximum(noise, shown)), steps)[:scalars]
        least = np.minimum.reduce(self._blocks)[at]
        readings = used * np.concatenate([y[self._places], self._turns])
        unpredicted = None if off is None else used * off[at]
        touching = isinstance(self._system, SteppedSystem) and self._system.touching > 0
        self.faults.read(t, readings, EncoderErrors(noise, shown, least, steps), unpredicted, touching=touching)
        self.faults.repeats[~used] = 0.0

    def expect(self, y: Array, predicted: Array) -> None:
        """Take the position (size,) that was ``predicted`` for the reading y (size,) that was taken last."""
        if self._newest is not None:
            self._expect(y, innovation(self._manifold, predicted, y))

    def _expect(self, y: Array, L: Array | None) -> None:
        if self._newest is None or L is None:
            return
        if self.declared:
            self._test(y, self._newest, L)
        else:
            self._innovations += 1
            _mean(self._predicted, L, self._innovations)

    def _residual(self, t: float, y: Array) -> Array | None:
        """r / sqrt(c) (n,) of a reading y (size,) of t [s]; None where a reading before it has no coordinates."""
        weights = cubic_weights([t, *(each for each, _ in reversed(self._past))])
        points = [innovation(self._manifold, y, p) for _, p in reversed(self._past)]
        if any(each is None for each in points):
            return None
        r: Array = -(weights @ np.array(points)) / math.sqrt(1.0 + float(weights @ weights))
        return r

    def _learn(self) -> bool:
        """Update the variances and steps; True if they have changed by as much as matters."""
        variance = self._smooth.copy()
        if self._innovations >= _FEWEST:
            variance = np.minimum(variance, self._predicted)
        steps = np.zeros(len(variance))
        steps[self._coordinates] = self._assumed_steps()
        variance = np.maximum(variance, np.square(steps) / 12.0)
        variance[self._coordinates[~self._encoders.known]] = 0.0
        ratio = (variance + _LEAST**2) / (self.variance + _LEAST**2)
        alike = np.abs(steps - self.steps) <= 2.0 * _MULTIPLE * steps
        if alike.all() and (ratio <= _RELEARN).all() and (ratio >= 1.0 / _RELEARN).all():
            return False
        self.variance, self.steps = variance, steps
        return True

    def _assumed_steps(self) -> Array:
        """Steps (k,) of the encoders: those found, and of a joint that stands those of the others."""
        steps, standing = self._encoders.steps.copy(), self._encoders.standing
        for kind in (self._hinges, ~self._hinges):
            alike = float(steps[kind].max(initial=0.0))
            steps[standing & kind] = alike or float(steps.max(initial=0.0))
        return steps

    def _test(self, y: Array, r: Array, L: Array) -> None:
        """Test what is declared by every fifth reading."""
        if self._count % (POINTS + 1):
            return
        if self._tested is None or self._windows is None:
            rounding = np.square(rounding_steps(self._mission, y))
            self._tested = reading_variance(self._mission, y) + rounding * (1.0 / 4.0 - 1.0 / 12.0)
            period = (POINTS + 1) * self._mission.period
            kappa = 1.0 + CLIP**2 * self._mission.reading.jump  # with the outliers that are declared
            self._windows = Windows(Thresholds.of(len(r), period, _WINDOWS), len(r), kappa)
        e = np.minimum(np.abs(r), np.abs(L)) / np.sqrt(self._tested)
        self._windows.add(np.copysign(e, r), np.full(len(r), np.nan))


def _mean(mean: Array, values: Array, count: int) -> None:
    """Update a mean (n,) of squares by ``values`` (n,), the ``count``-th of them; outliers count as large ones."""
    squares = np.square(values)
    if count > _FEWEST:
        squares = np.minimum(squares, _CLIP * mean)
    mean += (squares - mean) / min(float(count), _MEMORY)


@njit(cache=True, nogil=True)
def refine(
    changes: Array, found: Array, counted: Array, alike: Array, varied: Flags, confirmed: Array, still: Array
) -> None:
    """Find the steps (k,) of which all magnitudes of changes (k,) so far are multiples; 0 where none exists."""
    for i in range(len(changes)):
        change = changes[i]
        if not change > _STILL:
            still[i] += 1.0
            continue
        varied[i] |= counted[i] > 0.0 and (still[i] > 0.0 or abs(change - found[i]) > _MULTIPLE * change)
        still[i] = 0.0
        counted[i] += 1.0
        if found[i] == 0.0 or change <= _FAR * found[i]:
            step = _common_step(max(found[i], change), min(found[i], change))
            if not step >= (1.0 - _MULTIPLE) * found[i]:
                alike[i] = 0.0
            alike[i] += abs(change - step) <= _MULTIPLE * step
            found[i] = step
        if counted[i] >= _BLOCK:
            confirmed[i] = found[i] if varied[i] else 0.0
            found[i], counted[i], alike[i], varied[i] = np.inf, 0.0, 0.0, False


@njit(cache=True, nogil=True)
def _common_step(a: float, b: float) -> float:
    """Greatest step of which a >= b are multiples; b if a is infinite, 0 if none matters."""
    if not math.isfinite(a):
        return b
    while b > _LEAST:
        rest = abs(a - round(a / b) * b)
        if rest <= _MULTIPLE * b:
            return b
        a, b = b, rest
    return 0.0
