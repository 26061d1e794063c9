"""A search of the places of beacons by what a flight has read, a part of it at each call.

Of each beacon in turn,

1. a batch fit about the carrier's way finds all places that explain what was read of it (``flight_place_fit``);
2. a joint filter of flight and places (``flight_joint``) is run from the carrier's state before the first reading, once
   about each such place, until the batch fit and the filter agree;
3. a place is believed if no other is as likely as 1 to e^20, its residuals are those of its declared noise, and it is
   known so well that a Gaussian describes it, at two deviations along its worst direction.

The last is so for all kinds of readings of it, rho the least distance from the way to the place:

- ranges and differences leave it on a sphere of radius rho, which bends by 2 sigma_max^2 / rho there: that is at most
  the deviation sigma_min across;
- bearings leave it on a ray, where the angle between the rays from two ends of the way, which goes as one over the
  distance, is what is Gaussian. Two deviations off, the place is at rho / (1 - 2 s) with s = sigma_max / rho, not at
  rho (1 + 2 s). It is at most one deviation farther, 4 s^2 / (1 - 2 s) <= s, for 6 sigma_max <= rho.

What was read meanwhile is used at the end. How much is done at a call is counted in steps of a filter, not in seconds:
so the same readings give the same places at the same times.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.beacons.flight_joint import OUTLIER, JointFlight, Noise, Step
from mathnavi.estimators.beacons.flight_place_fit import PlaceFit, PlaceReadings, place_fits
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.aerial.beacon_readings import AZIMUTH, DIFFERENCE, ELEVATION, NEAREST, RANGE

CHANCE = 1e-7
"""probability of a false alarm of a test"""
_FEWEST, _SHORTEST = 30, 5.0  # numbers read of a beacon, and time [s] that they span, before it is searched
_MOST = 4  # places that are compared
_EXCLUDED = 20.0  # logarithm of how much likelier the best place is than another one
_AGREED, _REPEATED = 0.1, 3  # squared distance in deviations of the batch fit from the joint filter; runs until it is
_ON_A_RAY = 6.0  # least distance of a place that bearings tell, over its deviation
_HOPELESS = 4.0  # deviation of a batch fit over sqrt(rho sigma) of a range from which on no filter is run
_FIT = 60  # steps of a filter that take as long as a batch fit
_TRIMMED = 9.0  # square of an innovation, where outliers are declared


@dataclass(frozen=True, eq=False)
class Kept:
    """A step, with the carrier's time, state (9,) and covariance (9, 9) before it, and its position (3,) after it."""

    step: Step
    t: float
    x: Array
    P: Array
    p: Array


class _Run:
    """A joint filter on its way through a window, about a place of one beacon."""

    def __init__(self, joint: JointFlight, rows: Integers, place: Array) -> None:
        self.joint, self.place = joint, place
        self._rows, self._k = frozenset(rows.tolist()), 0
        self.innovations: list[float] = []

    def go_on(self, window: Sequence[Kept], steps: int) -> int:
        """Use at most ``steps`` steps; return the number used."""
        last = min(self._k + steps, len(window))
        for kept in window[self._k : last]:
            self.innovations += [e for k, e in self.joint.advance(kept.step) if k in self._rows]
        used, self._k = last - self._k, last
        return used

    def is_at_the_end(self, window: Sequence[Kept]) -> bool:
        """True once all steps were used."""
        return self._k == len(window)


class PlaceSearch:
    """A search of the places of ``numbers``, next to those that ``joint`` has."""

    def __init__(
        self, noise: Noise, window: Sequence[Kept], joint: JointFlight | None, numbers: Sequence[int], outliers: bool
    ) -> None:
        self._noise, self._window, self._outliers = noise, tuple(window), outliers
        self._left = list(numbers)
        self._runs: list[_Run] = []
        self._repeats = -1  # of the run about the best place; -1 while places are compared
        self._later: list[Step] = []
        self.joint = joint
        """filter that has the places found, and those that were known before"""
        self.found = False
        """whether there is one that was not known before"""
        self.said: dict[int, str] = {}
        """why a place is not known, by the number of the beacon"""

    def add(self, step: Step) -> None:
        """Add a step that was read after the search began."""
        self._later.append(step)

    def go_on(self, steps: int) -> bool:
        """Search for as long as ``steps`` steps of a filter take; return whether the search has ended."""
        while steps > 0:
            if self._runs:
                run = next((each for each in self._runs if not each.is_at_the_end(self._window)), None)
                if run is not None:
                    steps -= run.go_on(self._window, steps)
                    continue
                self._compare() if self._repeats < 0 else self._settle()
            elif self._left:
                self._begin(self._left[0])
                steps -= _FIT
            elif self.found and self._later:
                assert self.joint is not None
                self.joint.advance(self._later.pop(0))
                steps -= 1
            else:
                return True
        return False

    # ---- one beacon

    def _begin(self, i: int) -> None:
        """Fit places of beacon i, and begin a filter about each."""
        read, times = self._read_of(i)
        if len(times) < _FEWEST or max(times) - min(times) < _SHORTEST:
            self._end("waits for its readings")
            return
        fits = place_fits(read, outliers=self._outliers)
        if len(fits) > _MOST:
            self._end("other places explain its readings as well")
        elif fits[0].deviation > self._hopeless(read, fits[0].place):
            self._end(_uncertain(fits[0].deviation))
        else:
            self._runs, self._repeats = [self._run(i, fit) for fit in fits], -1

    def _rows(self, i: int) -> Integers:
        """Rows of beacon i."""
        return np.flatnonzero(self._noise.rows.beacons == i)

    def _read_of(self, i: int) -> tuple[PlaceReadings, list[float]]:
        """Readings of beacon i, and their times [s]."""
        rows = self._noise.rows
        numbers = [
            (k, at, y[k], kept)
            for k in self._rows(i).tolist()
            for kept in self._window
            for at, y in kept.step.readings
            if math.isfinite(y[k])
        ]
        at = np.array([each[0] for each in numbers], dtype=np.int64)
        kinds, y = rows.kinds[at], np.array([each[2] for each in numbers])
        p = np.array([each[3].p for each in numbers]).reshape(-1, 3)
        P = np.array([each[3].P[:3, :3] for each in numbers]).reshape(-1, 3, 3)
        differs = kinds == DIFFERENCE
        variance, reference = rows.variance[at] + rows.common * differs, np.zeros((len(y), 3))
        if differs.any():
            d = p[differs] - rows.places[0]
            range_0 = np.maximum(np.linalg.norm(d, axis=1), NEAREST)
            y[differs] += range_0
            reference[differs] = d / range_0[:, None]
        return PlaceReadings(kinds, y, variance, p, P, reference), [each[1] for each in numbers]

    def _run(self, i: int, fit: PlaceFit | Array) -> _Run:
        place = fit.place if isinstance(fit, PlaceFit) else fit
        placed = {} if self.joint is None else {k: self.joint.place(k)[0] for k in self.joint.numbers}
        first = self._window[0]
        about = {k: (each, math.dist(each, first.p)) for k, each in (*placed.items(), (i, place))}
        return _Run(JointFlight(self._noise, first.t, first.x, first.P, about), self._rows(i), place)

    def _compare(self) -> None:
        """Go on with the likeliest place if the others are out of the question."""
        self._runs.sort(key=lambda run: run.joint.log_likelihood, reverse=True)
        best, *others = self._runs
        if any(run.joint.log_likelihood > best.joint.log_likelihood - _EXCLUDED for run in others):
            self._end("another place explains its readings as well, such as a mirror image")
            return
        self._runs, self._repeats = [best], 0

    def _settle(self) -> None:
        """Believe the place if the filter agrees with that about which it was run; else run it about its own."""
        i, run = self._left[0], self._runs[0]
        place, P = run.joint.place(i)
        d = place - run.place
        if float(d @ np.linalg.solve(P, d)) >= _AGREED:
            self._repeats += 1
            if self._repeats > _REPEATED:
                self._end(_uncertain(_deviation(P)))
            else:
                self._runs = [self._run(i, place)]
            return
        uncertain = [k for k in run.joint.numbers if self._is_bent(k, *run.joint.place(k))]
        squares = np.minimum(np.square(run.innovations), _TRIMMED if self._outliers else OUTLIER)
        if uncertain:
            self._end(_uncertain(_deviation(run.joint.place(uncertain[-1])[1])))
        elif squares.sum() > chdtri(len(squares), CHANCE):
            self._end("no place explains its readings within their declared noise")
        else:
            run.joint.about = None
            self.joint, self.found = run.joint, True
            self._end("")

    def _end(self, why: str) -> None:
        """Leave the first beacon, and say why its place is not known."""
        self.said[self._left.pop(0)] = why
        self._runs = []

    # ---- bounds

    def _hopeless(self, read: PlaceReadings, place: Array) -> float:
        """Deviation [m] from which on a filter would not help."""
        rho = float(np.linalg.norm(read.p - place, axis=1).min())
        lengths = (read.kinds == RANGE) | (read.kinds == DIFFERENCE)
        on_sphere = (
            _HOPELESS * math.sqrt(rho * math.sqrt(float(read.variance[lengths].min()))) if lengths.any() else math.inf
        )
        return on_sphere if lengths.all() else min(on_sphere, rho)

    def _is_bent(self, i: int, place: Array, P: Array) -> bool:
        """True for a place (3,) of beacon i, of covariance P (3, 3) [m^2], that is not Gaussian by what was read."""
        rows = self._rows(i)
        least, _, largest = np.linalg.eigvalsh(P).tolist()
        kinds, rho = set[int](), math.inf
        for kept in self._window:
            for _, y in kept.step.readings:
                if len(read := rows[np.isfinite(y[rows])]):
                    kinds |= set(self._noise.rows.kinds[read].tolist())
                    rho = min(rho, math.dist(kept.p, place))
        on_sphere = bool(kinds & {RANGE, DIFFERENCE}) and 2.0 * largest > rho * math.sqrt(max(least, 0.0))
        return on_sphere or (bool(kinds & {AZIMUTH, ELEVATION}) and _ON_A_RAY * math.sqrt(largest) > rho)


def _deviation(P: Array) -> float:
    """Standard deviation [m] in the worst direction."""
    return math.sqrt(float(np.linalg.eigvalsh(P)[-1]))


def _uncertain(deviation: float) -> str:
    return f"its place is known to {deviation:.3g} m, one sigma, in a direction"
