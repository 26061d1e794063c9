"""Attitude from a gyro and an accelerometer alone, on published logs: ``inertial_attitude``, VQF and Madgwick's filter.

    python -m benchmarks.attitude --data FOLDER [--trials 06 16 21] [--delay 0.0026]

FOLDER has trials of BROAD (D. Laidig, M. Caruso, A. Cereatti, T. Seel, Data 6(7), 2021, github.com/dlaidig/broad, CC BY
4.0) as MATLAB files, ``06_undisturbed_fast_rotation_A.mat`` and so on; a trial that is not there is named and left out,
and the exit code is 1. The others take part where they are installed (``pip install vqf ahrs``), as their packages have
them: VQF 6D with and without its estimate of the gyro's bias, Madgwick's filter with the gain 0.033 of its package.

Errors are those of BROAD: root mean squares over the part of a trial that is marked as movement, of the inclination;
*drift* is the error of the heading relative to the first second before the movement, *total* the error of the attitude
with that drift. No filter has a tuning of its own for a trial. *delay* is another row: the attitudes of each are led on
by its rate for so long, because the gyro lags behind the cameras.
"""

from __future__ import annotations

import importlib
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

import mathnavi as mn
from benchmarks.arguments import read_arguments
from mathnavi.estimators.invariant.inclination_kernels import turned
from mathnavi.interfaces.bounds import NonNegative, configuration
from mathnavi.interfaces.field_table import TOGETHER
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.sim.records.attitude_figures import attitude_errors, inclination_covariance

MADGWICK_GAIN = 0.033  # of the package for an inertial measurement unit
_BEFORE = 1.0  # [s] before the movement over which headings are compared


@dataclass(frozen=True)
class Trial:
    """A trial of BROAD."""

    name: str
    rate: float  # [Hz]
    gyro: Array  # (n, 3) [rad/s]
    force: Array  # (n, 3) [m/s^2]
    truth: Array  # (n, 4), NaN where the cameras did not see it
    moving: NDArray[np.bool_]  # (n,)

    @property
    def log(self) -> mn.SensorLog:
        """The log for estimators."""
        t = np.arange(len(self.gyro)) / self.rate
        return mn.SensorLog(t, {"imu": np.hstack([self.gyro, self.force])}, source=self.name)


@dataclass(frozen=True)
class Row:
    """What a filter made of a trial."""

    words: str
    q: Array  # (n, 4)
    seconds: float  # of CPU time
    covariance: Array | None = None  # (n, 4, 4)


def read_trial(file: Path) -> Trial:
    """Read a trial; LogError for a file that is none."""
    log = mn.read_log(file, "matlab", rate_array="sampling_rate")
    gyro, force, truth, moving = (log[name].values for name in ("imu_gyr", "imu_acc", "opt_quat", "movement"))
    return Trial(file.stem, float(log.facts["sampling_rate"]), gyro, force, truth, moving.ravel() > 0.5)


def ours(trial: Trial) -> Row:
    """Run ``inertial_attitude`` with its defaults."""
    mission, log = mn.InertialMission(period=1.0 / trial.rate), trial.log
    begun = time.process_time()
    found = mn.estimate("inertial_attitude", mission, log)
    return Row("inertial_attitude", found.x, time.process_time() - begun, found.covariance)


def rivals(trial: Trial) -> Iterator[Row]:
    """Run the others, those that are installed."""
    gyro, force = np.ascontiguousarray(trial.gyro), np.ascontiguousarray(trial.force)
    try:
        vqf: Any = importlib.import_module("vqf")
    except ImportError:
        print("VQF is not installed; allowed: pip install vqf")
    else:
        off = {"motionBiasEstEnabled": False, "restBiasEstEnabled": False}
        for words, fields in (("VQF", {}), ("VQF, without bias", off)):
            begun = time.process_time()
            q = vqf.VQF(1.0 / trial.rate, **fields).updateBatch(gyro, force)["quat6D"]
            yield Row(words, q, time.process_time() - begun)
    try:
        ahrs: Any = importlib.import_module("ahrs.filters")
    except ImportError:
        print("ahrs is not installed; allowed: pip install ahrs")
    else:
        begun = time.process_time()
        q = ahrs.Madgwick(gyr=gyro, acc=force, frequency=trial.rate, gain=MADGWICK_GAIN).Q
        yield Row(f"Madgwick, gain {MADGWICK_GAIN}", q, time.process_time() - begun)


def led_on(row: Row, trial: Trial, delay: float) -> Row:
    """Lead the attitudes of a row on for ``delay`` [s] by the rates that are read."""
    q = np.array([turned(q, delay * rate) for q, rate in zip(row.q, trial.gyro, strict=True)])
    return Row(f"{row.words}, {1e3 * delay:g} ms on", q, row.seconds, row.covariance)


def figures(row: Row, trial: Trial) -> dict[str, float]:
    """Root mean squares [deg] over the movement, NEES over 2 and the share that is sure and wrong, NaN without a
    covariance, and the time of an update [us].
    """
    known = ~np.isnan(trial.truth[:, 0])
    ahead = int(np.argmax(trial.moving)) - np.arange(len(known))  # readings before the movement
    before = known & (ahead > 0) & (ahead <= round(_BEFORE * trial.rate))
    inclination, heading = attitude_errors(row.q, trial.truth)
    if before.any():
        heading = wrapped(heading - math.atan2(np.sin(heading[before]).mean(), np.cos(heading[before]).mean()))
    tilt, kept = np.hypot(*inclination.T), known & trial.moving
    whole = 2.0 * np.arccos(np.clip(np.cos(0.5 * tilt) * np.cos(0.5 * heading), -1.0, 1.0))
    found = {"inclination": tilt, "drift": heading, "total": whole}
    answers = {name: math.degrees(float(np.sqrt(np.square(error[kept]).mean()))) for name, error in found.items()}
    answers["us"] = 1e6 * row.seconds / len(row.q)
    if row.covariance is None:
        return {**answers, "nees": math.nan, "wrong": math.nan}
    P, e = inclination_covariance(row.q[kept], row.covariance[kept]), inclination[kept]
    nees = (e * np.linalg.solve(P, e[:, :, None])[:, :, 0]).sum(axis=1)
    return {**answers, "nees": float(nees.mean()) / 2.0, "wrong": float((nees > chdtri(2, 1e-3)).mean())}


@configuration
class AttitudeArguments:
    """Attitude without a magnetometer, on trials of BROAD, beside VQF and Madgwick's filter where installed."""

    data: Path
    """folder with the trials as .mat files"""
    trials: Annotated[tuple[str, ...], TOGETHER] = ("06", "16", "21")
    """numbers of the trials"""
    delay: NonNegative = 0.0026
    """time by which attitudes are led on in the second half of the rows; none with 0 [s]"""


def main(options: AttitudeArguments) -> int:
    """Print the table; 1 if a trial is not there."""
    print(f"{'':40}{'inclination':>12}{'drift':>8}{'total':>8}{'NEES':>8}{'wrong':>8}{'CPU':>10}")
    print(f"{'':40}{'[deg]':>12}{'[deg]':>8}{'[deg]':>8}{'/2':>8}{'[%]':>8}{'[us]':>10}")
    whole = True
    for number in options.trials:
        files = sorted(options.data.glob(f"{number}_*.mat"))
        if not files:
            whole = False
            print(
                f"trial {number}: there is no {options.data / number}_*.mat; see the head of this file for where it is"
            )
            continue
        run(read_trial(files[0]), options.delay)
    return 0 if whole else 1


def run(trial: Trial, delay: float) -> None:
    """Print the rows of a trial."""
    print(trial.name)
    rows = [ours(trial), *rivals(trial)]
    for row in [*rows, *(led_on(row, trial, delay) for row in rows if delay)]:
        each = figures(row, trial)
        judged = "" if math.isnan(each["nees"]) else f"{each['nees']:8.2f}{100.0 * each['wrong']:8.2f}"
        print(
            f"  {row.words:38}{each['inclination']:12.3f}{each['drift']:8.2f}{each['total']:8.2f}{judged:16}"
            f"{each['us']:10.1f}",
            flush=True,
        )


if __name__ == "__main__":
    sys.exit(main(read_arguments(AttitudeArguments)))
