"""The observer on mechanisms without a closed-form distance, which the thesis leaves open (D.6).

The metric is MuJoCo's mass matrix. The mechanisms are arms with two and seven joints, a cart and pendulum, and those of
the suite of dm_control, which were not made for this: some touch the ground, meet limits or are damped. One run of a
mechanism is recorded, and every estimator is run over the same readings.

Estimators called tuned, and all baselines, are tuned by a stated sweep of one field on a separate run; the observer's
omega is given. Reported errors are of another run, with another frequency; encoders have no noise, only quantisation.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.models.manifold.mission import POSITION, LagrangianMission
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.tuning import RecordedCall, recorded_calls, replayed, spread, tuned
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.scenarios.arm_velocity import VEHICLE, ArmVelocityConfig, believed
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult

BITS, OMEGA = 14, 30.0
BEGIN = 1.0  # [s] from when on errors count
OFTEN = 10  # calls between what is kept of an error over time
LOAD = 1.3  # times the mass of the last link, where the model errs
CUTOFFS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 50.0, 80.0, 120.0, 180.0, 250.0)  # [Hz]
DENSITIES = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)  # [rad/s^1.5]
OWN = ("two-link", "seven-joint", "cart-pendulum")
SUITE = (
    "acrobot", "ball_in_cup", "cartpole", "cheetah", "finger", "hopper", "pendulum", "reacher", "walker",
)  # fmt: skip
OBSERVER, TUNED = "observer", "observer, tuned"
DISTURBED, DISTURBED_TUNED = "observer, disturbance", "observer, disturbance, tuned"
BUTTERWORTH, HIGH_GAIN, MOMENTUM, EKF, UKF = "Butterworth", "high gain", "momentum observer", "EKF", "UKF"
BANDWIDTHS = (
    0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0, 80.0, 120.0, 200.0, 300.0, 500.0, 1000.0,
)  # fmt: skip  # [1/s]
SWEPT: Mapping[str, tuple[str, str, tuple[float, ...]]] = {
    TUNED: ("riemannian_observer", "bandwidth", BANDWIDTHS),
    DISTURBED_TUNED: ("riemannian_observer", "bandwidth", BANDWIDTHS),
    BUTTERWORTH: ("filtered_differences", "cutoff", CUTOFFS),
    HIGH_GAIN: ("high_gain", "bandwidth", BANDWIDTHS),
    MOMENTUM: ("momentum_observer", "bandwidth", BANDWIDTHS),
    EKF: ("lagrangian_ekf", "acceleration", DENSITIES),
    UKF: ("lagrangian_ukf", "acceleration", DENSITIES[::2]),  # a decade apart, for what it costs
}
"""plug-in, swept field and its values, by estimator"""
COLOURS = {
    OBSERVER: "#0d5fa8", TUNED: "#6aa5d8", DISTURBED: "#0f9472", DISTURBED_TUNED: "#7cc9b0",
    BUTTERWORTH: "#c2183b", HIGH_GAIN: "#e07b00", MOMENTUM: "#8a6d3b",
    EKF: "#7a4fb5", UKF: "#b79ad8",
}  # fmt: skip
TUNED_AT, SHOWN_AT = 2.5, 3.0  # [rad/s]
LEAST = {"two-link": 100.0, "seven-joint": 15.0}  # times below the best Butterworth
GAINED = {"two-link": 3.0, "seven-joint": 1.8}  # times, by the disturbance
MOST = {"two-link": 150.0, "seven-joint": 300.0}  # [us]
LOADED = (OBSERVER, DISTURBED, TUNED, DISTURBED_TUNED, BUTTERWORTH, HIGH_GAIN, EKF)
INTRINSIC = (OBSERVER, TUNED, DISTURBED_TUNED)  # of the suite, which have to run throughout
SLOW = (EKF, UKF)  # estimators that are left out of the suite
NEEDED = 5  # mechanisms that were not made for this
HELPS = 1.1  # times below the best Butterworth, from which the observer helps
Group = Mapping[str, Mapping[str, Mapping[str, Any]]]  # rows by mechanism and estimator


@configuration
class MechanismsConfig:
    """Sample sizes: runs."""

    own: Count = len(OWN)
    """largest number of mechanisms of this project"""
    suite: Count = len(SUITE)
    """largest number of mechanisms of dm_control's suite"""
    values: Count = len(DENSITIES)
    """largest number of values of a sweep, spread over its range"""
    seconds: Count = 5
    """duration of a run [s]"""


class Mechanisms:
    """The observer on any mechanism that MuJoCo can load, with its mass matrix as the metric (D.6)."""

    Config = MechanismsConfig
    quick = MechanismsConfig(suite=2, values=4, seconds=2)
    title = "Any mechanism: the mass matrix as the metric"
    on_terrain = False

    @staticmethod
    def run(config: MechanismsConfig, setup: Setup) -> StudyResult:
        mechanisms = OWN[: config.own]
        timed = [name for name in MOST if name in mechanisms]
        exact = [name for name in (OBSERVER, *SWEPT) if name != DISTURBED_TUNED]
        quick = [name for name in (OBSERVER, *SWEPT) if name not in SLOW]
        jobs, T = Jobs(), float(config.seconds)
        for name in mechanisms:
            motion = MechanismMotion(name, SHOWN_AT, T, seed=2)
            heavier = replace(motion, load=LOAD)
            jobs.add("own", compared, [motion], estimators=exact, values=config.values, shown=name == OWN[0])
            jobs.add("loaded", compared, [heavier], estimators=LOADED, values=config.values)
        for name in SUITE[: config.suite]:
            motion = MechanismMotion(f"dm_control:{name}", SHOWN_AT, T, tracked=False, seed=2)
            jobs.add("suite", compared, [motion], estimators=quick, values=config.values)
        jobs.add("costs", update_cost, [MechanismMotion(name, SHOWN_AT, T, seed=2) for name in timed])
        done = jobs.done(setup)
        groups = [[row for pairs in done[group] for row, _ in pairs] for group in ("own", "loaded", "suite")]
        own, loaded, suite = (_by_mechanism(rows) for rows in groups)
        costs = {name: float(np.median(times)) for name, times in zip(timed, done["costs"], strict=True)}
        over_time = {row["estimator"]: errors for row, errors in done["own"][0]}
        grids = ", ".join(f"{name} {grid[0]:g} to {grid[-1]:g}" for name, (_, _, grid) in SWEPT.items())
        return StudyResult(
            summary=(
                f"Encoders of {BITS} bits at 1 kHz, omega = {OMEGA:g} unless it is tuned. Every estimator is run over "
                f"the same readings: joints to and fro with {SHOWN_AT:g} rad/s, the suite's with a sine on every "
                f"actuator. Baselines, and what is called tuned, are tuned on another run, at {TUNED_AT:g} rad/s: "
                f"{grids}. Error: root mean square of |qvel^ - qvel| from 1 s on.",
                "With an exact model the tuned observer has no lead over tuned high gain and Kalman filters: without "
                "noise the error is that of rounding, and all trust the model. Where it errs a higher gain alone does "
                "about what a Butterworth filter does; a disturbance state, tuned, does better.",
            ),
            rows=[row for rows in groups for row in rows],
            tables=(_table("Our own mechanisms", own), _loaded(loaded), _table("dm_control's suite", suite)),
            figure=_figure(own, loaded, suite, over_time),
            caption="(a) Error of the joint velocities, by estimator. (b) The last link is 30 % heavier than believed: "
            "without and with the disturbance, each with omega = 30 and tuned, and its rivals, tuned. (c) The two-link "
            "arm: error over time. (d) dm_control's suite: how many times below the best Butterworth filter the "
            "observer is, red: above it; below each, with the disturbance, tuned.",
            claims=_claims(own, loaded, suite, costs),
        )


def _by_mechanism(rows: Iterable[Mapping[str, Any]]) -> Group:
    """Return rows by mechanism, named as in tables, and estimator."""
    found: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in rows:
        found.setdefault(row["mechanism"].removeprefix("dm_control:"), {})[row["estimator"]] = row
    return found


def _times(rows: Mapping[str, Mapping[str, Any]], above: str, below: str) -> float:
    """Return the ratio of the errors of two estimators, from rows of a mechanism by estimator."""
    return float(rows[above]["error"] / rows[below]["error"])


def _number(ratio: float) -> str:
    """Write a ratio with two digits, without an exponent."""
    return f"{ratio:.0f}" if ratio >= 10.0 else f"{ratio:.2g}"


def _claims(own: Group, loaded: Group, suite: Group, costs: Mapping[str, float]) -> list[Claim]:
    """Evaluate every claim of the study; ``costs`` are CPU times [us] of an update, by mechanism."""
    better = {name: _times(own[name], BUTTERWORTH, OBSERVER) for name in LEAST if name in own}
    gain = {name: _times(loaded[name], OBSERVER, DISTURBED) for name in GAINED if name in own}
    on_suite, disturbed = (
        {name: _times(rows, BUTTERWORTH, by) for name, rows in suite.items()} for by in (OBSERVER, DISTURBED_TUNED)
    )
    helped, helped_too = (
        {name: _number(ratio) for name, ratio in ratios.items() if ratio >= HELPS} for ratios in (on_suite, disturbed)
    )
    others = {name: _number(ratio) for name, ratio in on_suite.items() if name not in helped}
    intrinsic = [rows[name] for rows in suite.values() for name in INTRINSIC]
    fallen = [row for row in intrinsic if not _ran(row)]
    refused = sum(row["refused"] for row in intrinsic)
    ended = f"not throughout on {', '.join(map(_fall, fallen))}" if fallen else (
        f"throughout on all, {refused} readings refused"
    )  # fmt: skip
    return [
        Claim(
            "riemannian.mechanisms", "target", "Encoders give joint velocities better by the observer.", "D.1, D.6",
            f"exact model: at least {LEAST['two-link']:g} times below the best Butterworth for two joints, "
            f"{LEAST['seven-joint']:g} for seven",
            ", ".join(f"{name} {ratio:.0f} times ({_error_text(own[name])})" for name, ratio in better.items()),
            all(ratio >= LEAST[name] for name, ratio in better.items()),
        ),
        Claim(
            "riemannian.model-error", "target", "A transported disturbance makes up for an error of the model.", "D.6",
            f"last link 30 % heavier, omega = {OMEGA:g} with and without it: at least {GAINED['two-link']:g} and "
            f"{GAINED['seven-joint']:g} times",
            "; ".join(
                f"{name} {ratio:.1f} times, {loaded[name][OBSERVER]['error']:.3f} to "
                f"{loaded[name][DISTURBED]['error']:.3f} rad/s; both tuned "
                f"{_number(_times(loaded[name], TUNED, DISTURBED_TUNED))} times, "
                + ", ".join(f"{each.removeprefix('observer, ')} {_cell(loaded[name][each])}" for each in LOADED[2:])
                for name, ratio in gain.items()
            ),
            all(ratio >= GAINED[name] for name, ratio in gain.items()),
        ),
        Claim(
            "riemannian.cost", "target", "An update is cheap.", "D.6",
            f"curvature included, at most {MOST['two-link']:g} us for two joints and {MOST['seven-joint']:g} for seven",
            ", ".join(f"{name} {cost:.0f} us" for name, cost in costs.items()),
            all(cost <= MOST[name] for name, cost in costs.items()),
        ),
        Claim(
            "riemannian.menagerie", "target", "It runs on mechanisms that were not made for it.", "D.6",
            f"at least {NEEDED} MJCF mechanisms, on all with a finite error and without a restart; and where it helps",
            f"{len(suite)} of dm_control's suite, {ended}; it helps on {len(helped)} ({_joined(helped)} times); not on "
            f"{_joined(others) or 'none'}; with a disturbance, tuned, on {len(helped_too)} ({_joined(helped_too)})",
            len(suite) >= NEEDED and not fallen,
        ),
        Claim(
            "D.prohibitive", "printed", "Distance and transport are prohibitive unless the space is simple.", "D.6",
            "no update in real time at 1 kHz on seven joints",
            f"by series in the mass matrix at most {max(costs.values()):.0f} us",
            max(costs.values()) > 1000.0,
        ),
    ]  # fmt: skip


def _joined(texts: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {text}" for name, text in texts.items())


def _ran(row: Mapping[str, Any]) -> bool:
    """Return True if an estimator ran throughout, with a finite error and without restarts."""
    return not row["raised"] and bool(np.isfinite(row["error"])) and not (row["restarts"] or row["lost"])


def _fall(row: Mapping[str, Any]) -> str:
    """Return a text on a run that an estimator did not complete."""
    ended = row["raised"] or f"error {row['error']:.2g}, {row['restarts']} restarts, {row['lost']} lost"
    return f"{row['mechanism']} ({row['estimator']}: {ended})"


def _error_text(rows: Mapping[str, Mapping[str, Any]]) -> str:
    error = {name: f"{row['error']:.2g}" for name, row in rows.items()}
    tuned = _joined({name.removeprefix("observer, "): error[name] for name in (TUNED, HIGH_GAIN, EKF)})
    return f"{error[OBSERVER]} against {error[BUTTERWORTH]} rad/s; {tuned}"


def _table(title: str, group: Group) -> Table:
    names = list(next(iter(group.values())))
    cells = [
        (mechanism, f"{rows[names[0]]['peak']:.1f}", *(_cell(rows[name]) for name in names))
        for mechanism, rows in group.items()
    ]
    return Table(f"{title}: error [rad/s, m/s]", ("mechanism", "peak", *names), cells)


def _loaded(group: Group) -> Table:
    cells = [
        (name, *(_cell(rows[each]) for each in LOADED), f"{_times(rows, OBSERVER, DISTURBED):.1f}",
         _number(_times(rows, TUNED, DISTURBED_TUNED)))
        for name, rows in group.items()
    ]  # fmt: skip
    head = ("mechanism", *LOADED, "times less", "both tuned")
    return Table("The last link 30 % heavier than believed", head, cells)


def _cell(row: Mapping[str, Any]) -> str:
    if row["raised"]:
        return str(row["raised"])
    swept = "" if np.isnan(row["setting"]) else f" ({row['setting']:g}{', at the edge' if row['at_edge'] else ''})"
    return f"{row['error']:.2g}{swept}"


def _figure(own: Group, loaded: Group, suite: Group, over_time: Mapping[str, Sequence[float]]) -> Figure:
    """Draw the figure of the study; ``over_time`` are errors on the first mechanism of this project, by estimator."""
    with styled_figure((13.0, 8.2)) as page:
        axes = page.subplots(2, 2, width_ratios=(1.35, 1.0))
        _draw_bars(axes[0, 0], own, "(a) exact model: error of the joint velocities")
        _draw_bars(axes[0, 1], loaded, "(b) last link 30 % heavier than believed")
        _draw_series(axes[1, 0], over_time)
        _draw_suite(axes[1, 1], suite)
    return page


def _draw_bars(axes: Axes, group: Group, title: str) -> None:
    axes.set_title(title)
    names = list(next(iter(group.values())))
    width = 0.8 / len(names)
    for k, name in enumerate(names):
        x = np.arange(len(group)) + width * (k - 0.5 * (len(names) - 1))
        axes.bar(x, [rows[name]["error"] for rows in group.values()], 0.92 * width, color=COLOURS[name], label=name)
    axes.set_xticks(range(len(group)), list(group))
    axes.set(yscale="log", ylabel="[rad/s, m/s]")
    axes.grid(axis="x", visible=False)
    errors = [row["error"] for rows in group.values() for row in rows.values() if np.isfinite(row["error"])]
    axes.set_ylim(0.3 * min(errors), max(errors) * 30.0)
    axes.legend(loc="upper left", ncols=3 if len(names) == 6 else 2, fontsize=8.0)


def _draw_series(axes: Axes, over_time: Mapping[str, Sequence[float]]) -> None:
    axes.set_title("(c) two-link arm: error over time")
    for name in (BUTTERWORTH, OBSERVER):
        error = np.maximum(over_time[name], 1e-6)
        t = 1e-3 * OFTEN * np.arange(len(error))
        axes.plot(t, error, color=COLOURS[name], lw=1.2)
        annotate(axes, name, (t[len(t) // 2], float(np.median(error))), (0, 16), color=COLOURS[name], weight="bold")
        axes.set_xlim(0.0, t[-1])
    axes.set(yscale="log", xlabel="time [s]", ylabel="[rad/s]")


def _draw_ratio(axes: Axes, height: float, value: float, colour: str) -> None:
    axes.plot([1.0, value], [height, height], color=colour, lw=5.0, solid_capstyle="butt")
    side = 1 if value >= 1.0 else -1
    annotate(axes, f"{value:.0f}" if value >= 10.0 else f"{value:.2g}", (value, height), (6 * side, 0), va="center",
             ha="left" if side > 0 else "right", color=colour, weight="bold", fontsize=8.5)  # fmt: skip


def _draw_suite(axes: Axes, suite: Group) -> None:
    axes.set_title("(d) dm_control's suite: times below the best Butterworth")
    ratios, disturbed = (
        {name: _times(rows, BUTTERWORTH, by) for name, rows in suite.items() if np.isfinite(rows[by]["error"])}
        for by in (OBSERVER, DISTURBED_TUNED)
    )
    order = sorted(set(ratios) & set(disturbed), key=lambda name: ratios[name])
    for k, name in enumerate(order):
        colour = COLOURS[OBSERVER] if ratios[name] >= 1.0 else COLOURS[BUTTERWORTH]
        _draw_ratio(axes, k + 0.17, ratios[name], colour)
        _draw_ratio(axes, k - 0.2, disturbed[name], COLOURS[DISTURBED_TUNED])
    axes.axvline(1.0, color=INK, lw=1.0)
    axes.set_yticks(range(len(order)), order)
    axes.set_xscale("log")
    every = (*ratios.values(), *disturbed.values(), 1.0)
    low, high = min(every), max(every)
    axes.set(xlim=(low / 4.0, high * 4.0), ylim=(-0.6, len(order) - 0.4))
    axes.grid(axis="y", visible=False)


@dataclass(frozen=True)
class MechanismMotion:
    """Mechanism and its motion."""

    mechanism: str  # as the scenario calls it
    frequency: float  # [rad/s]
    seconds: float  # of the run
    load: float = 1.0
    tracked: bool = True  # joints to and fro; else every actuator is given a sine
    seed: int = 0
    amplitude: float = 1.0  # of the sine, where every actuator is given one


@cache
def recorded(motion: MechanismMotion) -> tuple[LagrangianMission, list[RecordedCall]]:
    """Record a run with the observer in the loop, as the mission and the calls of an estimator."""
    fields: dict[str, Any] = {
        "mechanism": motion.mechanism, "load": motion.load, "duration": motion.seconds, "settled": 0.0,
        "reading.resolution": BITS, "estimator.bandwidth": OMEGA, "planner.frequency": motion.frequency,
    }  # fmt: skip
    controller = "joint_tracking"
    if not motion.tracked:
        controller = "input_signal"
        inputs = len(believed(ArmVelocityConfig(mechanism=motion.mechanism)).system.inputs)
        fields["planner.amplitude"] = (motion.amplitude,) * inputs
    flight = trial("arm-velocity", motion.seed, controller=controller, fields=fields)
    return believed(flight.spec.config), recorded_calls(flight.flown().recording, VEHICLE, POSITION)


def compared(
    motion: MechanismMotion, estimators: Sequence[str], values: int, shown: bool = False
) -> list[tuple[dict[str, Any], list[float]]]:
    """A job: by estimator its row over the same readings, and |qvel^ - qvel| every ``OFTEN`` calls if ``shown``.

    A sweep has at most ``values`` values; an exception becomes part of the row.
    """
    return [_comparison(name, motion, values, shown) for name in estimators]


def _comparison(name: str, motion: MechanismMotion, values: int, shown: bool) -> tuple[dict[str, Any], list[float]]:
    row = {"mechanism": motion.mechanism, "load": motion.load, "estimator": name}
    try:
        mission, calls = recorded(motion)
        rates = slice(mission.system.manifold.size, None)
        peak = float(np.abs([call.truth[rates] for call in calls]).max())  # [rad/s, m/s] the largest joint speed
        plugin, config, setting, at_edge = _tuned(name, motion, values)
        ran = replayed(plugin.build(config, mission), calls, rates)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError, mujoco.FatalError) as error:
        row |= {"error": np.nan, "setting": np.nan, "at_edge": False, "peak": np.nan}
        return row | {"restarts": 0, "refused": 0, "lost": 0, "raised": f"{type(error).__name__}: {error}"}, []
    row |= {"error": ran.rms(BEGIN), "setting": setting, "at_edge": at_edge, "peak": peak}
    row |= {"restarts": ran.restarts, "refused": ran.refused, "lost": ran.lost, "raised": ""}
    return row, ran.error[::OFTEN].tolist() if shown else []


def _tuned(name: str, motion: MechanismMotion, most: int) -> tuple[Any, Any, float, bool]:
    """Return a plug-in, its tuned configuration, the value of the swept field, and whether that is an edge value."""
    if name not in SWEPT:
        plugin = load("estimators", "riemannian_observer")
        return plugin, plugin.Config(bandwidth=OMEGA, disturbance=name == DISTURBED), float("nan"), False
    called, swept, grid = SWEPT[name]
    plugin = load("estimators", called)
    config = plugin.Config(disturbance=True) if name == DISTURBED_TUNED else plugin.Config()
    values = spread(grid, most)
    if len(values) == 1:  # there is nothing to choose from
        return plugin, replace(config, **{swept: values[0]}), values[0], True
    mission, calls = recorded(replace(motion, frequency=TUNED_AT, seed=1))
    rates = slice(mission.system.manifold.size, None)
    found = tuned(plugin, config, mission, calls, swept, values, rates, BEGIN)
    return plugin, replace(config, **{swept: found.best}), found.best, found.at_edge


def update_cost(motion: MechanismMotion) -> list[MeasuredTime]:
    """A job: CPU times [us] of one update of the observer with its curvature term, medians over blocks of a hundred."""
    mission, calls = recorded(motion)
    plugin = load("estimators", "riemannian_observer")
    estimator = plugin.build(plugin.Config(bandwidth=OMEGA), mission)
    times: list[float] = []
    for call in calls:
        began = time.thread_time_ns()
        estimator.update(call.t, call.measurements, call.command)
        times.append(1e-3 * (time.thread_time_ns() - began))
    blocks: Sequence[Any] = np.array_split(np.array(times[100:]), max(1, (len(times) - 100) // 100))
    return [MeasuredTime(np.median(block)) for block in blocks]
