"""A search of the places of beacons by what a flight has read, a part of it at each call.

Of each beacon in turn,

1. a batch fit about the carrier's way finds all places that explain its ranges (``flight_place_fit``);
2. a joint filter of flight and places (``flight_joint``) is run from the carrier's state before the first reading, once
   about each such place, until the batch fit and the filter agree;
3. a place is believed if no other is as likely as 1 to e^20, its residuals are those of its declared noise, and it is
   known so well that a Gaussian describes it: two deviations along its worst direction, the sphere on which a range rho
   leaves it bends by 2 sigma_max^2 / rho, which is at most the deviation sigma_min across.

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
from mathnavi.estimators.beacons.flight_place_fit import PlaceFit, place_fits
from mathnavi.interfaces.signals import Array

CHANCE = 1e-7
"""probability of a false alarm of a test"""
_FEWEST, _SHORTEST = 30, 5.0  # ranges of a beacon, and time [s] that they span, before it is searched
_MOST = 4  # places that are compared
_EXCLUDED = 20.0  # logarithm of how much likelier the best place is than another one
_AGREED, _REPEATED = 0.1, 3  # squared distance in deviations of the batch fit from the joint filter; runs until it is
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

    def __init__(self, joint: JointFlight, i: int, place: Array) -> None:
        self.joint, self.place = joint, place
        self._i, self._k = i, 0
        self.innovations: list[float] = []

    def go_on(self, window: Sequence[Kept], steps: int) -> int:
        """Use up to so many steps; return how many."""
        last = min(self._k + steps, len(window))
        for kept in window[self._k : last]:
            self.innovations += [e for k, e in self.joint.advance(kept.step) if k == self._i]
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
        self._std = math.sqrt(noise.range_variance)
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
        """Search for as long as so many steps of a filter take; return whether the search is at its end."""
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
        read = [(at, y[i], kept) for kept in self._window for at, y in kept.step.ranges if math.isfinite(y[i])]
        if len(read) < _FEWEST or read[-1][0] - read[0][0] < _SHORTEST:
            self._end("waits for its ranges")
            return
        y, p = np.array([each[1] for each in read]), np.array([each[2].p for each in read])
        P = np.array([each[2].P[:3, :3] for each in read])
        fits = place_fits(p, P, y, self._std, outliers=self._outliers)
        if len(fits) > _MOST:
            self._end("other places explain its ranges as well")
        elif fits[0].deviation > _HOPELESS * math.sqrt(float(y.min()) * self._std):
            self._end(_uncertain(fits[0].deviation))
        else:
            self._runs, self._repeats = [self._run(i, fit) for fit in fits], -1

    def _run(self, i: int, fit: PlaceFit | Array) -> _Run:
        place = fit.place if isinstance(fit, PlaceFit) else fit
        placed = {} if self.joint is None else {k: self.joint.place(k)[0] for k in self.joint.numbers}
        first = self._window[0]
        about = {k: (each, math.dist(each, first.p)) for k, each in (*placed.items(), (i, place))}
        return _Run(JointFlight(self._noise, first.t, first.x, first.P, about), i, place)

    def _compare(self) -> None:
        """Go on with the likeliest place if the others are out of the question."""
        self._runs.sort(key=lambda run: run.joint.log_likelihood, reverse=True)
        best, *others = self._runs
        if any(run.joint.log_likelihood > best.joint.log_likelihood - _EXCLUDED for run in others):
            self._end("another place explains its ranges as well, such as a mirror image")
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
        uncertain = [k for k in run.joint.numbers if _is_bent(run.joint.place(k)[1], self._least(k))]
        squares = np.minimum(np.square(run.innovations), _TRIMMED if self._outliers else OUTLIER)
        if uncertain:
            self._end(_uncertain(_deviation(run.joint.place(uncertain[-1])[1])))
        elif squares.sum() > chdtri(len(squares), CHANCE):
            self._end("no place explains its ranges within their declared noise")
        else:
            run.joint.about = None
            self.joint, self.found = run.joint, True
            self._end("")

    def _end(self, why: str) -> None:
        """Leave the first beacon, and say why its place is not known."""
        self.said[self._left.pop(0)] = why
        self._runs = []

    # ---- bounds

    def _least(self, i: int) -> float:
        """Least range [m] of beacon i in the window; inf without any, which no deviation is too large for."""
        all_ranges = (y[i] for kept in self._window for _, y in kept.step.ranges)
        return min((float(y) for y in all_ranges if math.isfinite(y)), default=math.inf)


def _deviation(P: Array) -> float:
    """Standard deviation [m] in the worst direction."""
    return math.sqrt(float(np.linalg.eigvalsh(P)[-1]))


def _is_bent(P: Array, rho: float) -> bool:
    """True for a place of covariance P (3, 3) [m^2] that is not Gaussian, with ranges of at least rho [m]."""
    least, _, largest = np.linalg.eigvalsh(P).tolist()
    return bool(2.0 * largest > rho * math.sqrt(max(least, 0.0)))


def _uncertain(deviation: float) -> str:
    return f"its place is known to {deviation:.3g} m, one sigma, in a direction"
