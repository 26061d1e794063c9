"""Attitude without a magnetometer, on trials of BROAD: ``inertial_attitude``, VQF and Madgwick's filter.

Errors are those of BROAD (D. Laidig, M. Caruso, A. Cereatti, T. Seel, Data 6(7), 2021): root mean squares over the part
of a trial that is marked as movement, of the inclination against cameras, and their mean over trials. *Drift* is the
error of the heading relative to the first second before the movement, *total* the error of the attitude with that
drift. No filter is tuned for a trial. The others take part where they are installed (``pip install vqf ahrs``): VQF 6D
with and without its estimate of the gyro's bias, Madgwick's filter with the gain of its package.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.input_files import InputFile
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.inertial_mission import InertialMission
from mathnavi.sim.logs.formats import read_log
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from mathnavi.sim.records.attitude_figures import attitude_errors, inclination_covariance
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.sensor_log import SensorLog, estimate
from mathnavi.sim.records.table import Row
from mathnavi.studies.real.judging import row
from mathnavi.studies.real.published import peer

OURS = "inertial_attitude"
MADGWICK_GAIN = 0.033  # of the package for an inertial measurement unit
_BEFORE = 1.0  # [s] before the movement over which headings are compared


@dataclass(frozen=True)
class AttitudeLog:
    """File of a trial."""

    file: Annotated[str, InputFile()]


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
    def log(self) -> SensorLog:
        """The log for estimators."""
        t = np.arange(len(self.gyro)) / self.rate
        return SensorLog(t, {"imu": np.hstack([self.gyro, self.force])}, source=self.name)


@dataclass(frozen=True)
class Attitudes:
    """Attitudes of a trial by one filter, with the CPU time."""

    words: str
    q: Array  # (n, 4)
    seconds: float  # of CPU time
    covariance: Array | None = None  # (n, 4, 4)
    ok: NDArray[np.bool_] | None = None  # (n,)


def read_trial(file: Path) -> Trial:
    """Read a trial; raises LogError for a file that is not a trial."""
    log = read_log(file, "matlab", rate_array="sampling_rate")
    gyro, force, truth, moving = (log[name].values for name in ("imu_gyr", "imu_acc", "opt_quat", "movement"))
    return Trial(file.stem, float(log.facts["sampling_rate"]), gyro, force, truth, moving.ravel() > 0.5)


def ours(trial: Trial) -> Attitudes:
    """Run ``inertial_attitude`` with its defaults."""
    mission, log = InertialMission(period=1.0 / trial.rate), trial.log
    begun = time.process_time()
    found = estimate(OURS, mission, log)
    return Attitudes(OURS, found.x, time.process_time() - begun, found.covariance, found.ok)


def rivals(trial: Trial) -> Iterator[Attitudes]:
    """Run the others, those that are installed."""
    gyro, force = np.ascontiguousarray(trial.gyro), np.ascontiguousarray(trial.force)
    vqf, ahrs = peer("vqf"), peer("ahrs")
    if vqf is not None:
        off: dict[str, Any] = {"motionBiasEstEnabled": False, "restBiasEstEnabled": False}
        nothing: dict[str, Any] = {}
        for words, fields in (("VQF", nothing), ("VQF, without bias", off)):
            begun = time.process_time()
            q = vqf.VQF(1.0 / trial.rate, **fields).updateBatch(gyro, force)["quat6D"]
            yield Attitudes(words, q, time.process_time() - begun)
    if ahrs is not None:
        begun = time.process_time()
        q = ahrs.filters.Madgwick(gyr=gyro, acc=force, frequency=trial.rate, gain=MADGWICK_GAIN).Q
        yield Attitudes(f"Madgwick, gain {MADGWICK_GAIN}", q, time.process_time() - begun)


def figures(found: Attitudes, trial: Trial) -> dict[str, float]:
    """Root mean squares [deg] over the movement, NEES over 2 and the share that is sure and wrong, NaN without a
    covariance, and the time of an update [us].
    """
    known = ~np.isnan(trial.truth[:, 0])
    ahead = int(np.argmax(trial.moving)) - np.arange(len(known))  # readings before the movement
    before = known & (ahead > 0) & (ahead <= round(_BEFORE * trial.rate))
    inclination, heading = attitude_errors(found.q, trial.truth)
    if before.any():
        heading = wrapped(heading - math.atan2(np.sin(heading[before]).mean(), np.cos(heading[before]).mean()))
    tilt, kept = np.hypot(*inclination.T), known & trial.moving
    whole = 2.0 * np.arccos(np.clip(np.cos(0.5 * tilt) * np.cos(0.5 * heading), -1.0, 1.0))
    errors = {"inclination": tilt, "drift": heading, "total": whole}
    answers = {name: math.degrees(float(np.sqrt(np.square(error[kept]).mean()))) for name, error in errors.items()}
    answers["us"] = 1e6 * found.seconds / len(found.q)
    if found.covariance is None or found.ok is None:
        return {**answers, "nees": math.nan, "wrong": math.nan}
    P, e = inclination_covariance(found.q[kept], found.covariance[kept]), inclination[kept]
    nees = (e * np.linalg.solve(P, e[:, :, None])[:, :, 0]).sum(axis=1)
    t = np.flatnonzero(kept) / trial.rate
    wrong = sure_and_wrong(t, found.ok[kept], e, P, (slice(0, 2),))
    return {**answers, "nees": float(nees.mean()) / 2.0, "wrong": float(wrong.mean())}


def attitude_rows(log: AttitudeLog) -> list[Row]:
    """A job: rows of all filters on a trial."""
    trial = read_trial(Path(log.file))
    found = []
    for each in (ours(trial), *rivals(trial)):
        made = figures(each, trial)
        found.append(
            row(
                part="attitude", log=trial.name, estimator=each.words, inclination_rms_deg=made["inclination"],
                heading_rms_deg=made["drift"], total_rms_deg=made["total"], nees=made["nees"],
                wrong_share=made["wrong"], update_us=MeasuredTime(made["us"]),
            )
        )  # fmt: skip
    return found
