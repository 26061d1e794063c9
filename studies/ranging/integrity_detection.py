"""Time from which on a fault of a robot's sensors can be found: by the non-central chi-square of the monitor's windows.

Readings without noise, with the fault, run through the filter of the declared model, an extended Kalman filter that
knows the start. What its normalised innovations then are is the mean by which the fault shifts them; their sums over
the windows are the non-centralities lambda of the monitor's statistics:

    mean       P = Phi(|sum e_i| / sqrt n - z)
    energy     P = P(rho_i chi'2_n(sum e_i^2 / rho_i) > chi2_n(alpha))
    joint      P = P(rho chi'2_(n l)(sum w'w / rho) > chi2_(n l)(alpha))
    reckoned   P = P(chi'2_3(d' P_open^-1 d) > chi2_3(alpha))

where rho_i is the variance of a ray's noise over the declared one, if the fault makes it larger, and rho their mean. A
fault can be found from the first update on at which the largest P is 0.99. It is a bound from below of what the tests
find together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chndtr, ndtr

from mathnavi.estimators.integrity.pose_kernels import AGE, begin_branch, no_branches, reckoned
from mathnavi.estimators.integrity.pose_protection import no_responses
from mathnavi.estimators.integrity.ranging import PoseWitness
from mathnavi.estimators.integrity.windows import FEWEST, Flags, Thresholds
from mathnavi.estimators.ranging.pose_filter import RangeEkf
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.unicycle.mission import RangingMission

LIKELY = 0.99
"""probability from which on a fault counts as one that can be found"""

_BRANCHED = 12  # updates between two branches
LARGER = 1.2  # of rho, that is no error of a sample

Update = tuple[float, tuple[Measurement, ...], Array]


def findable(mission: RangingMission, updates: Sequence[Update], during: slice, spread: Array) -> Flags:
    """True (n,) from the update on at which the fault of the ``updates`` can be found, which have no noise.

    ``spread`` (l,) is the variance of the noise of each ray ``during`` the fault, over the declared one.
    """
    shift, joint, squares, witness = _shifts(mission, updates)
    thresholds = witness.windows.thresholds
    z, energy, l = thresholds.z, thresholds.energy, len(spread)  # noqa: E741
    chance = 1.0 - chndtr(energy[3], 3, squares)
    rho = np.ones((len(updates), l))
    rho[during] = np.where(spread > LARGER, spread, 1.0)
    for length in thresholds.lengths.tolist():
        count = np.minimum(np.arange(1, len(updates) + 1), length)
        sums, own, all_, scale = (windowed(each, length) for each in (shift, shift**2, joint, rho))
        scale /= count[:, None]
        chance = np.maximum(chance, ndtr(np.abs(sums) / np.sqrt(count)[:, None] - z).max(axis=1))
        each = 1.0 - chndtr(energy[count][:, None] / scale, count[:, None], own / scale)
        whole = scale.mean(axis=1)
        together = 1.0 - chndtr(energy[count * l] / whole, count * l, all_ / whole)
        chance = np.maximum(chance, np.maximum(each.max(axis=1), together))
    return from_onset(chance, during.start)


def windowed(values: Array, length: int) -> Array:
    """Sums of the last ``length`` of values (n, ...)."""
    total = np.cumsum(values, axis=0)
    total[length:] -= total[:-length].copy()
    return total


def by_windows(e: Array, rho: Array, thresholds: Thresholds) -> Array:
    """The largest P (n,) by the windows, of shifts e (n, l) of normalised innovations, NaN where nothing is read, and
    their variance rho (n,) over the declared one.
    """
    read = np.isfinite(e)
    e = np.where(read, e, 0.0)
    chance: Array = np.zeros(len(e))
    for length in thresholds.lengths.tolist():
        sums, squares, count = (windowed(each, length) for each in (e, e**2, read.astype(np.float64)))
        factor = windowed(rho, length) / np.minimum(np.arange(1, len(e) + 1), length)
        asked = np.maximum(count, 1.0)
        mean = ndtr(np.abs(sums) / np.sqrt(asked) - thresholds.z)
        limit = thresholds.energy[count.astype(int)] / factor[:, None]
        energy = 1.0 - chndtr(limit, asked, squares / factor[:, None])
        chance = np.maximum(chance, np.where(count >= FEWEST, np.maximum(mean, energy), 0.0).max(axis=1))
        all_, total = squares.sum(axis=1) / factor, count.sum(axis=1)
        joint = 1.0 - chndtr(thresholds.energy[total.astype(int)] / factor, np.maximum(total, 1.0), all_)
        chance = np.maximum(chance, np.where(total >= FEWEST, joint, 0.0))
    return chance


def from_onset(chance: Array, onset: int) -> Flags:
    """True (n,) from the first update at or after ``onset`` on at which a fault is LIKELY found by P (n,)."""
    found: Flags = np.logical_or.accumulate((chance >= LIKELY) & (np.arange(len(chance)) >= onset))
    return found


def _shifts(mission: RangingMission, updates: Sequence[Update]) -> tuple[Array, Array, Array, PoseWitness]:
    """e (n, l), w'w (n,) and the largest d' P_open^-1 d (n,) of readings without noise, and the witness of them."""
    estimator, witness, rays = RangeEkf(RangeEkf.Config(), mission), PoseWitness(mission), mission.sensors
    lengths, used = witness.windows.thresholds.lengths, np.ones(rays + 1, dtype=np.bool_)
    branches = no_branches(int(lengths[-1]) // _BRANCHED + 2)
    responses, before = no_responses(len(branches), rays), None
    shift, joint, squares = np.zeros((len(updates), rays)), np.zeros(len(updates)), np.zeros(len(updates))
    for k, (t, measurements, command) in enumerate(updates):
        estimate = estimator.update(t, measurements, command)
        assert estimate.covariance is not None
        if before is not None:
            witness.take(before, estimate, measurements, command, used)
            sums, at = witness.windows.sums, witness.windows.k
            news = sums[at % len(sums)] - sums[(at - 1) % len(sums)]
            signs, joint[k] = np.sign(news[:rays]), news[-2]
            shift[k] = np.where(signs == 0.0, 1.0, signs) * np.sqrt(news[rays : 2 * rays])
            u = next((each.value for each in measurements if each.name == "odometry"), command)
            if np.isfinite(u).all():
                squares[k], _, _, _ = reckoned(
                    branches, lengths[1:], estimate.x, estimate.covariance, u, witness.constants, 0.0, mission.period,
                    False,
                )  # fmt: skip
            else:
                branches[:, AGE] = -1.0
        if k % _BRANCHED == 0:
            begin_branch(branches, responses, estimate.x, estimate.covariance)
        before = estimate
    return shift, joint, squares, witness
