"""The untuned observer on unmodified mechanisms: stiff servos, damping, limits, friction, fluid, contacts.

Encoders have 14 bits, a mechanism is moved by a sine on every actuator, and the last link may have half or one and a
half times the mass that every estimator assumes. The observer has its default fields and tunes itself. The other
estimators are tuned by a sweep on another run, with the assumed mass. Robots with gains, damping and encoders that are
not as they are believed to be are those of ``faulty_arms``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import mujoco
import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Status
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.tuning import RecordedCall, spread, tuned
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Jobs, Row, Setup, StudyResult
from mathnavi.studies.riemannian import faulty_arms
from mathnavi.studies.riemannian.faulty_arms import FAULTS, NONE, ROBOTS, at_hand, by_case
from mathnavi.studies.riemannian.mechanisms import (
    BITS,
    BUTTERWORTH,
    COLOURS,
    EKF,
    HIGH_GAIN,
    MOMENTUM,
    OBSERVER,
    SWEPT,
    UKF,
    MechanismMotion,
    recorded,
)

TUNED_AT, SHOWN_AT, BEGIN = 2.5, 3.0, 0.5  # [rad/s], [rad/s], [s] from when on errors count
WITHIN = 1.1  # times the error of the best rival
NOTHING = 1e-3  # of the greatest speed, below which an error counts as none
MOST_WRONG, MOST_FALSE = 0.005, 0.01  # of the time
TWICE, PAST = 2.0, 1.0  # times the greatest speed of the last second
SMALL = 9  # joints, up to which the Kalman filters, whose cost grows with their square, are rivals
NAMES = (OBSERVER, BUTTERWORTH, HIGH_GAIN, MOMENTUM, EKF, UKF)


@dataclass(frozen=True)
class ArmCase:
    """Mechanism with its load and the amplitude of its actuators."""

    mechanism: str
    load: float = 1.0
    amplitude: float = 1.0
    seconds: float = 4.0
    values: int = 15  # of a sweep, at most

    @property
    def label(self) -> str:
        """Name of the case in tables."""
        name = self.mechanism.removeprefix("dm_control:")
        load = "" if self.load == 1.0 else f", load {self.load:g}"
        return f"{name}{load}{', into its limits' if self.amplitude > 1.0 else ''}"

    def motion(self, frequency: float, load: float, seed: int) -> MechanismMotion:
        """Return the motion with a sine of ``frequency`` [rad/s] on every actuator."""
        return MechanismMotion(self.mechanism, frequency, self.seconds, load, False, seed, self.amplitude)


CASES = (
    *(ArmCase(arm, load) for arm in ("servo-six", "servo-seven", "servo-gripper") for load in (1.0, 1.5, 0.5)),
    ArmCase("servo-six", amplitude=2.9),
    *(ArmCase("swimmer", load) for load in (1.0, 1.5)),
    *(ArmCase(f"dm_control:{name}", load) for name in ("acrobot", "manipulator", "fish") for load in (1.0, 1.5)),
    *(ArmCase(f"dm_control:{name}", load) for name in ("humanoid",) for load in (1.0, 1.5)),
)


def compared(case: ArmCase) -> list[dict[str, Any]]:
    """A job: rows of the observer and its rivals over the same readings.

    ``error`` [rad/s, m/s] is the root mean square of |qvel^ - qvel| while an estimator is not lost, ``setting`` the
    value that it was tuned to, ``lost`` the share of lost estimates, ``worst`` the largest error while OK over the
    greatest speed of the last second, ``peak`` [rad/s, m/s] the greatest speed, and ``raised`` an exception.
    """
    mission = recorded(case.motion(TUNED_AT, 1.0, 1))[0]
    names = NAMES if mission.system.manifold.dimension <= SMALL else (OBSERVER, BUTTERWORTH, HIGH_GAIN, MOMENTUM)
    return [_errors(name, case) for name in names]


def _errors(name: str, case: ArmCase) -> dict[str, Any]:
    mission, calls = recorded(case.motion(SHOWN_AT, case.load, 2))
    rates = slice(mission.system.manifold.size, None)
    row: dict[str, Any] = {"case": case.label, "estimator": name}
    try:
        if name == OBSERVER:
            plugin, setting = load("estimators", "riemannian_observer"), np.nan
            config = plugin.Config()
        else:
            called, field, grid = SWEPT[name]
            plugin = load("estimators", called)
            before, others = recorded(case.motion(TUNED_AT, 1.0, 1))
            values = spread(grid, case.values)
            found = tuned(plugin, plugin.Config(), before, others, field, values, rates, BEGIN)
            setting, config = found.best, replace(plugin.Config(), **{field: found.best})
        error, lost, worst, peak = _judged(plugin.build(config, mission), calls, rates)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError, mujoco.FatalError) as fault:
        nothing = {"error": np.inf, **dict.fromkeys(("setting", "lost", "worst", "peak"), np.nan)}
        return {**row, **nothing, "raised": f"{type(fault).__name__}: {fault}"}
    return {**row, "error": error, "setting": setting, "lost": lost, "worst": worst, "peak": peak, "raised": ""}


def _judged(estimator: Estimator, calls: Sequence[RecordedCall], rates: slice) -> tuple[float, float, float, float]:
    """Return error, share of lost estimates, worst error while OK over the speed, and greatest speed, from BEGIN on."""
    t = np.array([call.t for call in calls])
    truth = np.array([call.truth[rates] for call in calls])
    estimates = [estimator.update(call.t, call.measurements, call.command) for call in calls]
    error = np.linalg.norm(np.array([estimate.x[rates] for estimate in estimates]) - truth, axis=1)
    ok = np.array([estimate.status is Status.OK for estimate in estimates])
    usable = np.array([estimate.status.usable for estimate in estimates])
    speed, window = np.linalg.norm(truth, axis=1), max(1, round(PAST / (t[1] - t[0])))
    greatest = np.array([speed[max(0, k - window) : k + 1].max() for k in range(len(speed))])
    late = t >= BEGIN
    kept = error[late & ok]
    worst = float((kept / np.maximum(greatest[late & ok], 1e-9)).max()) if len(kept) else 0.0
    rms = float(np.sqrt(np.mean(np.square(error[late & usable])))) if (late & usable).any() else np.inf
    return rms, float(1.0 - usable[late].mean()), worst, float(speed.max())


@configuration
class RealArmsConfig:
    """Sample sizes: runs."""

    cases: Count = len(CASES)
    """largest number of mechanisms with their loads"""
    values: Count = 8
    """largest number of values of a sweep"""
    seconds: Count = 4
    """duration of a run [s]"""
    robots: Count = len(ROBOTS)
    """largest number of robots with faults"""
    faults: Count = len(FAULTS)
    """largest number of faults, none among them"""


class RealArms:
    """The untuned observer on arms with servos and on mechanisms with limits, fluid and contacts."""

    Config = RealArmsConfig
    quick = RealArmsConfig(cases=1, values=4, seconds=2, robots=1, faults=2)
    title = "Servos, limits, fluid and contacts: the observer as it comes"
    on_terrain = False

    @staticmethod
    def run(config: RealArmsConfig, setup: Setup) -> StudyResult:
        """Run the study on the cases of ``config``."""
        jobs = Jobs()
        cases = [replace(each, seconds=float(config.seconds), values=config.values) for each in CASES[: config.cases]]
        jobs.add("cases", compared, cases)
        robots = at_hand(ROBOTS[: config.robots])
        missing = [robot for robot in ROBOTS[: config.robots] if robot not in robots]
        sizes = {"seconds": float(config.seconds), "values": config.values, "faults": config.faults}
        jobs.add("robots", faulty_arms.compared, robots, **sizes)
        done = jobs.done(setup)
        found: list[list[Row]] = done["cases"]
        faulty: list[Row] = [row for rows in done["robots"] for row in rows]
        return StudyResult(
            summary=(
                f"Encoders of {BITS} bits at 1 kHz; a sine of {SHOWN_AT:g} rad/s on every actuator. The observer has "
                f"no setting. Rivals are tuned on another run, at {TUNED_AT:g} rad/s, with the load that is believed."
                f" Error: root mean square of |qvel^ - qvel| from {BEGIN:g} s on, while an estimator is not lost.",
                f"With faults, errors count from {faulty_arms.SETTLED:g} s on"
                f"{'; not at hand: ' + ', '.join(missing) if missing else ''}. Sure and wrong: OK, and off by more "
                f"than {faulty_arms.DEVIATIONS:g} declared deviations for over {faulty_arms.LASTING:g} s.",
            ),
            rows=[row for errors in found for row in errors] + faulty,
            tables=(_table(found), _faulty_table(faulty)),
            figure=_figure(found),
            caption="Error of the joint velocities on each mechanism: the observer as it comes, its rivals tuned on "
            "another run.",
            claims=claims(found, faulty, missing),
        )  # fmt: skip


def claims(found: Sequence[Sequence[Row]], faulty: Sequence[Row], missing: Sequence[str]) -> list[Claim]:
    """Evaluate the claims of the study; ``missing`` are robots that are not at hand."""
    behind = []
    for ours, *rivals in found:
        best = min(rivals, key=itemgetter("error"))
        if ours["error"] > max(WITHIN * best["error"], NOTHING * ours["peak"]) or ours["raised"]:
            behind.append(f"{ours['case']}: {ours['error']:.2g} against {best['error']:.2g} ({best['estimator']})")
    ratios = [butterworth["error"] / ours["error"] for ours, butterworth, *_ in found]
    worst = max((errors[0] for errors in found), key=lambda row: np.nan_to_num(row["worst"], nan=np.inf))
    lost = max(errors[0]["lost"] for errors in found)
    return [
        Claim(
            "real-arms.best", "target", "Untuned, the observer is as good as the best tuned filter.", "D.6",
            f"on each mechanism within {100.0 * (WITHIN - 1.0):.0f}% of it, or under {100.0 * NOTHING:g}% of the "
            "greatest speed",
            f"on {len(found) - len(behind)} of {len(found)}{'; not on ' if behind else ''}{', '.join(behind)}; "
            f"{min(ratios):.1f} to {max(ratios):.0f} times below the tuned Butterworth filter; lost for at most "
            f"{100.0 * lost:.1f}% of a run; with faults {_best_text(faulty)}",
            not behind,
        ),
        Claim(
            "real-arms.honest", "target", "An estimate that is far off is said to be lost.", "D.6",
            f"never an error above {TWICE:g} times the greatest speed of the last second while its status is OK; with "
            f"gains, damping, load or encoders that are not as believed, sure and wrong for at most "
            f"{100.0 * MOST_WRONG:g}% of the time of a run, on {len(ROBOTS)} robots",
            f"at most {worst['worst']:.2g} times ({worst['case']}); with faults, on "
            f"{len({row['robot'] for row in faulty})} robots{_missing_text(missing)}, {_wrong_text(faulty)}",
            bool(worst["worst"] <= TWICE) and not missing and _most_wrong(faulty, OBSERVER)[0] <= MOST_WRONG,
        ),
        Claim(
            "real-arms.false-alarm", "target", "What is as declared raises no alarm.", "D.6",
            f"OK for at least {100.0 * (1.0 - MOST_FALSE):g}% of the time, each observer on each robot",
            _alarm_text(faulty),
            all(row["ok"] >= 1.0 - MOST_FALSE for row in faulty if row["fault"] == NONE.name),
        ),
    ]  # fmt: skip


def _missing_text(missing: Sequence[str]) -> str:
    return f" ({len(missing)} not at hand)" if missing else ""


def _best_text(faulty: Sequence[Row]) -> str:
    """Number of cases in which the observer is as good as the best of its tuned rivals, and the median ratio."""
    good, ratios = 0, []
    cases = by_case(faulty)
    for rows in cases.values():
        ours, rivals = rows[OBSERVER], [row for name, row in rows.items() if name != OBSERVER]
        best = min((row["error"] for row in rivals), default=np.inf)
        good += ours["error"] <= max(WITHIN * best, NOTHING * np.nan_to_num(ours["peak"]))
        if np.isfinite(best) and np.isfinite(ours["error"]):
            ratios.append(best / max(ours["error"], 1e-12))
    median = f", by the median {np.median(ratios):.2g} times below it" if ratios else ""
    return f"on {good} of {len(cases)}{median}"


def _most_wrong(faulty: Sequence[Row], estimator: str) -> tuple[float, str]:
    """The largest share of a run in which an estimator is sure and wrong, and the run."""
    rows = [row for row in faulty if row["estimator"] == estimator]
    worst = max(rows, key=lambda row: np.nan_to_num(row["wrong"], nan=1.0), default=None)
    if worst is None:
        return 0.0, "no run"
    share = float(np.nan_to_num(worst["wrong"], nan=1.0))
    return share, f"{100.0 * share:.2g}% ({worst['robot'].partition(':')[2] or worst['robot']}, {worst['fault']})"


def _wrong_text(faulty: Sequence[Row]) -> str:
    names = dict.fromkeys(row["estimator"] for row in faulty)
    return "at most " + ", ".join(f"{name} {_most_wrong(faulty, name)[1]}" for name in names)


def _alarm_text(faulty: Sequence[Row]) -> str:
    declared = [row for row in faulty if row["fault"] == NONE.name]
    least = {name: min(row["ok"] for row in declared if row["estimator"] == name) for name in
             dict.fromkeys(row["estimator"] for row in declared)}  # fmt: skip
    return "at least " + ", ".join(f"{name} {100.0 * share:.3g}%" for name, share in least.items())


def _faulty_table(faulty: Sequence[Row]) -> Table:
    names = (OBSERVER, *faulty_arms.RIVALS)
    rows = []
    for (robot, fault), by_name in by_case(faulty).items():
        cells = [_cell(by_name[name]) if name in by_name else "-" for name in names]
        ours = by_name[OBSERVER]
        shares = [f"{100.0 * ours[share]:.1f}%" for share in ("ok", "lost", "wrong")]
        rows.append((robot.removeprefix("dm_control:"), fault, f"{ours['peak']:.1f}", *cells, *shares))
    head = ("robot", "fault", "peak", *names, "OK", "lost", "sure and wrong")
    return Table("Error with faults [rad/s, m/s]; shares of the observer", head, rows)


def _table(found: Sequence[Sequence[Row]]) -> Table:
    rows = []
    for errors in found:
        by_name = {each["estimator"]: each for each in errors}
        cells = [_cell(by_name[name]) if name in by_name else "-" for name in NAMES]
        rows.append((errors[0]["case"], f"{errors[0]['peak']:.1f}", *cells, f"{100.0 * errors[0]['lost']:.1f}%"))
    return Table("Error [rad/s, m/s]", ("mechanism", "peak", *NAMES, "lost"), rows)


def _cell(row: Row) -> str:
    if row["raised"]:
        return str(row["raised"])
    return f"{row['error']:.2g}" + ("" if np.isnan(row["setting"]) else f" ({row['setting']:g})")


def _figure(found: Sequence[Sequence[Row]]) -> Figure:
    with styled_figure((10.0, 0.42 * len(found) + 2.0)) as page:
        axes = page.subplots()
        for name, marker in zip(NAMES, "os^vDP", strict=True):
            points = [
                (each["error"], k) for k, errors in enumerate(found) for each in errors
                if each["estimator"] == name and np.isfinite(each["error"]) and each["error"] > 0.0
            ]  # fmt: skip
            axes.plot(*np.reshape(points, (-1, 2)).T, marker, color=COLOURS[name], label=name, ms=7)
        axes.set_yticks(range(len(found)), [errors[0]["case"] for errors in found])
        axes.set(ylim=(len(found) - 0.5, -0.5), xscale="log", xlabel="error of the joint velocities [rad/s, m/s]")
        axes.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return page
