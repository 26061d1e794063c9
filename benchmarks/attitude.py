"""Attitude from a gyro and an accelerometer with a time offset: ``inertial_attitude`` against other filters.

    python -m benchmarks.attitude --data FOLDER [--trials 06 16 21] [--delay 0.0026]

Trials, filters and errors are those of ``mathnavi study real`` (``studies/real/attitude_logs.py``). FOLDER has trials
of BROAD (github.com/dlaidig/broad, CC BY 4.0) as MATLAB files, ``06_undisturbed_fast_rotation_A.mat`` and so on; a
missing trial is named and skipped, and the exit code is 1. The second half of the rows are the same attitudes,
predicted ahead by *delay* at the measured rate, because the gyro lags behind the cameras.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from benchmarks.arguments import read_arguments
from mathnavi.estimators.invariant.inclination_kernels import turned
from mathnavi.interfaces.bounds import NonNegative, configuration
from mathnavi.interfaces.field_table import TOGETHER
from mathnavi.studies.real.attitude_logs import Attitudes, Trial, figures, ours, read_trial, rivals


def ahead(found: Attitudes, trial: Trial, delay: float) -> Attitudes:
    """Predict attitudes ahead by ``delay`` [s] at the measured rates."""
    q = np.array([turned(q, delay * rate) for q, rate in zip(found.q, trial.gyro, strict=True)])
    return replace(found, words=f"{found.words}, {1e3 * delay:g} ms ahead", q=q)


@configuration
class AttitudeArguments:
    """Attitude without a magnetometer, on trials of BROAD, against VQF and Madgwick's filter where installed."""

    data: Path
    """folder with the trials as .mat files"""
    trials: Annotated[tuple[str, ...], TOGETHER] = ("06", "16", "21")
    """numbers of the trials"""
    delay: NonNegative = 0.0026
    """time by which the second half of the rows predicts attitudes ahead [s]; 0 for none"""


def main(options: AttitudeArguments) -> int:
    """Print the table; return 1 if a trial is missing."""
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
    for found in [*rows, *(ahead(each, trial, delay) for each in rows if delay)]:
        each = figures(found, trial)
        judged = "" if math.isnan(each["nees"]) else f"{each['nees']:8.2f}{100.0 * each['wrong']:8.2f}"
        print(
            f"  {found.words:38}{each['inclination']:12.3f}{each['drift']:8.2f}{each['total']:8.2f}{judged:16}"
            f"{each['us']:10.1f}",
            flush=True,
        )


if __name__ == "__main__":
    sys.exit(main(read_arguments(AttitudeArguments)))
