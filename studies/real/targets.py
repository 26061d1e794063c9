"""Targets of the study: required accuracy of estimators on published logs, and the measured one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.table import Row
from mathnavi.studies.framework.study import chosen
from mathnavi.studies.real import arm_filters, gtsam_peers
from mathnavi.studies.real.attitude_logs import OURS
from mathnavi.studies.real.floor_windows import BANK

FOUND, MOST_WRONG = 0.9, 0.005  # share of the windows, and of the time
ON_LINE, SMOOTHED, OF_BEST = 1.2, 1.0, 0.9  # times the error of the rival
FEW, MANY = 4, 8  # beams
SEEN = 0.5  # of what the laser sees, that the map of a window has in each scan that counts
FLOORS = ("intel", "freiburg-101")  # of which the target speaks, where they are at hand
FILTER, SMOOTHER = "beacon_bank", "smoother of beacon_bank"
Verdict = tuple[str, bool | None]  # what was measured, and whether it holds


@dataclass(frozen=True)
class RealTarget:
    """Claim of the study: ``judge`` returns the measurement and verdict of one or more rows."""

    id: str
    part: str
    statement: str
    source: str
    expected: str
    judge: Callable[[Sequence[Row]], Verdict]

    def claim(self, rows: Sequence[Row], reason: str) -> Claim:
        """The claim from the rows of its part; not measured, for a ``reason``, if there are none."""
        own = chosen(rows, part=self.part)
        measured, holds = self.judge(own) if own else (f"not measured: {reason}", None)
        return Claim(self.id, "target", self.statement, self.source, self.expected, measured, holds)


def _windows(rows: Sequence[Row]) -> str:
    return f"{sum(row['found'] for row in rows)} of {len(rows)}"


def _on_map(*kinds: Sequence[Row]) -> str:
    """Results, in words, in those windows of several ``kinds`` whose map has what the laser sees."""
    mapped = [[row for row in rows if row["mapped_share"] >= SEEN] for rows in kinds]
    return f"where the map explains half of all ranges in each last scan {' and '.join(map(_windows, mapped))}"


def _share(rows: Sequence[Row]) -> float:
    return float(np.mean([row["found"] for row in rows]))


def _wrong(rows: Sequence[Row]) -> float:
    return float(np.mean([row["wrong_share"] for row in rows]))


def judge_room(rows: Sequence[Row]) -> Verdict:
    """The bank with few beams and with many, in rooms."""
    few, many = (chosen(rows, estimator=BANK, beams=count) for count in (FEW, MANY))
    if not few or not many:
        return f"not measured with {FEW} and {MANY} beams", None
    wrong = _wrong([*few, *many])
    measured = (
        f"{_windows(few)} with {FEW} beams, {_windows(many)} with {MANY}; {_on_map(few, many)}; sure and wrong "
        f"{100.0 * wrong:.2g}%"
    )
    return measured, _share(few) >= FOUND and _share(many) >= 1.0 and wrong <= MOST_WRONG


def judge_floor(rows: Sequence[Row]) -> Verdict:
    """The bank with many beams, on each floor."""
    own = chosen(rows, estimator=BANK, beams=MANY)
    if not own:
        return f"not measured with {MANY} beams", None
    floors = {log: chosen(own, log=log) for log in dict.fromkeys(row["log"] for row in own)}
    judged = [floors[log] for log in FLOORS if log in floors] or list(floors.values())
    measured = ", ".join(f"{log} {_windows(of_log)}" for log, of_log in floors.items())
    wrong = f"sure and wrong {100.0 * _wrong(own):.2g}%"
    return f"{measured}; {_on_map(own)}; {wrong}", all(_share(each) >= FOUND for each in judged)


def judge_beacons(rows: Sequence[Row]) -> Verdict:
    """Filter and smoother with all beacons and a known start against GTSAM's best of the same kind, on each log."""
    measured, verdicts = [], []
    for log in dict.fromkeys(row["log"] for row in rows):
        of_log = chosen(rows, log=log)
        most = max(row["beams"] for row in of_log)
        words = []
        for how, name, rivals, times in (
            ("on line", FILTER, gtsam_peers.ON_LINE, ON_LINE),
            ("smoothed", SMOOTHER, gtsam_peers.SMOOTHED, SMOOTHED),
        ):
            ours = chosen(of_log, beams=most, estimator=name, start="known")[0]["position_rms_all_m"]
            theirs = [row for each in rivals for row in chosen(of_log, beams=most, estimator=each)]
            if theirs:
                best = min(theirs, key=lambda row: row["position_rms_all_m"])
                least = best["position_rms_all_m"]
                words.append(f"{how} {ours:.3f} m ({ours / least:.2f} of {best['estimator']}, {least:.3f} m)")
                verdicts.append(ours <= times * least)
            else:
                words.append(f"{how} {ours:.3f} m")
        measured.append(f"{log}: {', '.join(words)}")
    if len(verdicts) == 2 * len(measured):
        return "; ".join(measured), all(verdicts)
    return f"{'; '.join(measured)}; rival not at hand (GTSAM is not installed)", None


def judge_arm(rows: Sequence[Row]) -> Verdict:
    """The default observer against the best of the tuned rivals, on each log."""
    measured, holds = [], True
    for log in dict.fromkeys(row["log"] for row in rows):
        errors = {row["estimator"]: row["velocity_rms_rad_s"] for row in chosen(rows, log=log)}
        best = min(arm_filters.RIVALS, key=lambda name: errors[name])
        ratio = errors[arm_filters.DEFAULT] / errors[best]
        measured.append(f"{log}: {errors[arm_filters.DEFAULT]:.4f} rad/s, {ratio:.2f} of {best}")
        holds = holds and ratio <= OF_BEST
    return "; ".join(measured), holds


def judge_attitude(rows: Sequence[Row]) -> Verdict:
    """The mean error of ``inertial_attitude`` over trials against that of the best rival, and its number of wins."""
    trials = [chosen(rows, log=log) for log in dict.fromkeys(row["log"] for row in rows)]
    by_name = [{row["estimator"]: row["inclination_rms_deg"] for row in trial} for trial in trials]
    means = {name: float(np.mean([each[name] for each in by_name])) for name in by_name[0]}
    own = f"{OURS} {means.pop(OURS):.3f} deg in the mean of {len(trials)} trials"
    if not means:
        return f"{own}; rival not at hand (neither vqf nor ahrs is installed)", None
    best = min(means, key=means.__getitem__)
    wins = sum(each[OURS] <= min(error for name, error in each.items() if name != OURS) for each in by_name)
    wrong = 100.0 * max(row["wrong_share"] for row in chosen(rows, estimator=OURS))
    measured = f"{own}, {best} {means[best]:.3f} deg; the least error in {wins} trials; sure and wrong {wrong:.2g}%"
    return measured, float(np.mean([each[OURS] for each in by_name])) <= means[best]


_MAPS = "test scans at least 60 s from any scan of the map, errors against SLAM's poses"
TARGETS = (
    RealTarget(
        "real.room", "room", "With few beams of a laser a robot finds itself in a real room.", "C.4",
        f"within 0.3 m and 0.2 rad over the last quarter of 60 s in {FOUND:.0%} of the windows with {FEW} beams and "
        f"all with {MANY}, sure and wrong at most {100.0 * MOST_WRONG:g}% of the time; {_MAPS}", judge_room,
    ),
    RealTarget(
        "real.floor", "floor", "With eight beams and odometry a robot finds itself on a whole real floor.", "C.4",
        f"from an unknown start within 0.3 m and 0.2 rad over the last quarter of 60 s in {FOUND:.0%} of the windows "
        f"of the Intel lab and of Freiburg 101, {MANY} beams; {_MAPS}", judge_floor,
    ),
    RealTarget(
        "real.beacons", "beacons", "Among radio beacons a robot is located as well as by the best smoother.", "C.4",
        f"RMS error at all times at most {ON_LINE:g} of that of GTSAM's best on line, at most {SMOOTHED:g} of its "
        "batch smoother's; GTSAM with the scale of the ranges that the filter found", judge_beacons,
    ),
    RealTarget(
        "real.unicycles", "unicycles", "Among landmarks a unicycle is located as well as by the best smoother.", "C.4",
        f"RMS error at all times at most {ON_LINE:g} of that of GTSAM's best on line, at most {SMOOTHED:g} of its "
        "batch smoother's, each robot", judge_beacons,
    ),
    RealTarget(
        "real.arm", "arm", "Velocities of a real arm are better than by tuned filters.", "D.6",
        f"RMS error at most {OF_BEST:g} of the best of Butterworth, constant-acceleration Kalman filter and momentum "
        "observer, tuned on another log", judge_arm,
    ),
    RealTarget(
        "real.attitude", "attitude", "Without a magnetometer the vertical is known as well as by the best filter.",
        "2.3", "mean over trials of BROAD of the RMS inclination error while the device moves at most that of the best "
        "of VQF and Madgwick's filter, as their packages have them", judge_attitude,
    ),
)  # fmt: skip
