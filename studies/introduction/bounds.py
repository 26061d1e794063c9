"""Distance of estimators from the posterior Cramér-Rao bound, and the cost of an update.

Each system moves under inputs that do not depend on any estimate, with process noise and readings drawn from the model
that is declared to the estimators, so that an error above the bound is due to the estimator.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle
from operator import itemgetter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

from mathnavi.estimators.stagewise.flight import FlightModel
from mathnavi.estimators.stagewise.missile import MissileModel
from mathnavi.estimators.stagewise.model import StagewiseModel
from mathnavi.estimators.stagewise.smoother import square_root
from mathnavi.interfaces.bounds import Count, Seed, configuration
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.field.curve import ellipse
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.missile.coordinates import PLANAR
from mathnavi.models.missile.mission import CASES, GustStrength, MissileMission, StateNoise, Target
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.patterns import figure_eight
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.renders.figures import BOUND
from mathnavi.renders.study_report import Table
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.metrics.flight import flight_bound
from mathnavi.sim.metrics.lagrangian import lagrangian_bound
from mathnavi.sim.metrics.missile import missile_bound
from mathnavi.sim.metrics.posterior_bound import PosteriorBound
from mathnavi.sim.metrics.ranging import ranging_bound
from mathnavi.sim.metrics.tuning import RecordedCall
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult

NEAR = 1.15  # times the bound, which counts as reached
CHANCE = 3.0  # standard errors
FEWEST = 5  # runs that a standard error needs
PIECES = 50  # of a run, over each of which errors are averaged for the figure
COLOURS = ("#0d5fa8", "#e07b00", "#0f9472", "#7a4fb5", "#8a6d1f", "#6b7a8c")
DECLARED = "missile_kalman, declared"
TUNED: dict[str, tuple[str, dict[str, float]]] = {
    DECLARED: (
        "missile_kalman",
        {
            **{"force_std": 1e-3, "moment_std": 1e-3, "time_constant": 1.0},
            **{"start_position_std": 1e-3, "start_velocity_std": 1e-3, "start_angle_std": 1e-5, "start_rate_std": 1e-5},
        },
    )
}
"""estimators with non-standard fields: name in this study -> (plug-in, fields)"""


@dataclass(frozen=True)
class BoundScenario:
    """The estimators of a system, and the length, number and noise of its runs."""

    estimators: tuple[str, ...]
    seconds: float  # of a run
    repeats: int = 1  # times as many runs; more where errors change so slowly that a run is little more than a sample
    disturbed: bool = True  # process noise acts
    unit: str = "m"  # of the errors


SCENARIOS = {
    "ranges": BoundScenario(("feasible_set_bank", "range_ekf", "range_ukf", "range_particle", "moving_horizon"), 6.0),
    "flight": BoundScenario(("kalman", "moving_horizon"), 20.0),
    "missile": BoundScenario(("missile_kalman", DECLARED, "moving_horizon"), 4.0, repeats=4),
    "mechanism": BoundScenario(
        ("riemannian_observer", "lagrangian_ekf", "lagrangian_ukf", "high_gain", "filtered_differences",
         "moving_horizon"),
        2.0, disturbed=False, unit="rad/s",
    ),
}  # fmt: skip


@configuration
class BoundsConfig:
    """Sample sizes: runs."""

    seeds: Count = 10
    """number of seeds of each scenario; several times as many where errors change slowly"""
    seed: Seed = 0
    """first seed of each scenario"""
    scenarios: Count = len(SCENARIOS)
    """largest number of scenarios"""
    shortened: Count = 1
    """factor by which runs are shorter"""


class Bounds:
    """Every estimator on every scenario, compared with the posterior Cramér-Rao bound."""

    Config = BoundsConfig
    quick = BoundsConfig(seeds=2, shortened=2)
    title = "Estimators at the posterior Cramér-Rao bound"
    on_terrain = False

    @staticmethod
    def run(config: BoundsConfig, setup: Setup) -> StudyResult:
        """Run the study on the scenarios and seeds of ``config``."""
        jobs = Jobs()
        for name in list(SCENARIOS)[: config.scenarios]:
            seconds, runs = SCENARIOS[name].seconds / config.shortened, config.seeds * SCENARIOS[name].repeats
            jobs.add(name, compared, [BoundRun(name, config.seed + k, seconds) for k in range(runs)])
        by_estimator = [errors for runs in jobs.done(setup).values() for errors in zip(*runs, strict=True)]
        rows = [_row(errors) for errors in by_estimator]
        return StudyResult(
            summary=(
                "Every system moves with the very noise that is declared. Efficiency: the root of the sum of squared "
                "errors over that of the posterior Cramér-Rao bounds, over the second half of every run: of the "
                "position, and of the mechanism's joint velocities. Estimators have their standard fields; "
                f"{DECLARED} has the gusts and the exact start that are declared, without a reserve for a wrong mass. "
                "On the mechanism no noise acts, so that its bound is that of "
                "its start as a parameter, to which an estimator that allows for errors of its model cannot come.",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(rows, by_estimator),
            caption="Left: root mean square error over its posterior Cramér-Rao bound, against the CPU time of an "
            "update. Right: root mean square errors of all runs over time; in the mean of very many runs none is in "
            "what is shaded, below the bound.",
            claims=_claims(rows),
        )


def _row(errors: Sequence[BoundErrors]) -> dict[str, Any]:
    """Return the row of an estimator from its errors run by run; the standard error is the jackknife's over runs."""
    squares, bounds = np.array([e.squares for e in errors]), np.array([e.bounds for e in errors])
    n, spread = len(errors), math.inf
    if n >= FEWEST:
        without = np.sqrt((squares.sum() - squares) / (bounds.sum() - bounds))
        spread = float(np.sqrt((n - 1) * np.mean(np.square(without - without.mean()))))
    return {
        "scenario": errors[0].scenario,
        "estimator": errors[0].estimator,
        "efficiency": math.sqrt(squares.sum() / bounds.sum()),
        "standard_error": spread,
        "ok": float(np.mean([e.ok for e in errors])),
        "update_us_wall_s": float(np.median([e.cost for e in errors])),
    }


def _claims(rows: Sequence[dict[str, Any]]) -> list[Claim]:
    best = [
        min((row for row in rows if row["scenario"] == name), key=itemgetter("efficiency"))
        for name in dict.fromkeys(row["scenario"] for row in rows)
    ]
    far = [row for row in best if SCENARIOS[row["scenario"]].disturbed and row["efficiency"] > NEAR]
    below = [row for row in rows if row["efficiency"] + CHANCE * row["standard_error"] < 1.0]
    least = min(rows, key=itemgetter("efficiency"))
    return [
        Claim(
            "bounds.efficiency", "target", "Estimators reach the posterior Cramér-Rao bound.", "C.5",
            f"where process noise acts the best estimator's error is at most {NEAR:g} times the bound",
            ", ".join(f"{row['scenario']}: {row['efficiency']:.2f} ({row['estimator']})" for row in best),
            not far,
        ),
        Claim(
            "bounds.valid", "target", "No estimator beats the bound.", "C.5",
            f"no efficiency is below 1 by more than {CHANCE:g} standard errors",
            f"the least is {least['efficiency']:.2f} ± {least['standard_error']:.2f} ({least['estimator']}, "
            f"{least['scenario']})",
            not below,
        ),
    ]  # fmt: skip


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Error over the bound", rows, (
        ("scenario", "scenario"), ("estimator", "estimator"),
        ("efficiency", "{efficiency:.3g} ± {standard_error:.2g}"), ("OK", lambda row: f"{100.0 * row['ok']:.1f}%"),
        ("µs an update", "{update_us_wall_s:.0f}"),
    ))  # fmt: skip


def _figure(rows: Sequence[dict[str, Any]], by_estimator: Sequence[Sequence[BoundErrors]]) -> Figure:
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    with styled_figure((12.0, 3.1 * len(names))) as page:
        drawn = page.subplots(len(names), 2, squeeze=False, width_ratios=(1.0, 1.5))
        for (against_cost, over_time), name in zip(drawn, names, strict=True):
            _draw_efficiency(against_cost, [row for row in rows if row["scenario"] == name])
            _draw_course(over_time, [errors for errors in by_estimator if errors[0].scenario == name])
            against_cost.set_title(name)
        drawn[-1, 0].set_xlabel("CPU time of an update [µs]")
        drawn[-1, 1].set_xlabel("time [s]")
    return page


def _draw_efficiency(axes: Axes, rows: Sequence[dict[str, Any]]) -> None:
    axes.axhline(1.0, color=BOUND, ls=":", lw=1.2)
    for row, colour in zip(rows, cycle(COLOURS), strict=False):
        value, spread = row["efficiency"], row["standard_error"] if math.isfinite(row["standard_error"]) else 0.0
        axes.errorbar(
            row["update_us_wall_s"], value, min(spread, 0.9 * value), fmt="o", ms=6, capsize=3, color=colour
        )  # fmt: skip
    axes.set(xscale="log", yscale="log", ylabel="error / bound")
    axes.margins(x=0.2, y=0.2)
    lowest, highest = axes.get_ylim()
    axes.yaxis.set_major_locator(MaxNLocator(5) if highest < 10.0 * lowest else LogLocator())
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())


def _draw_course(axes: Axes, by_estimator: Sequence[Sequence[BoundErrors]]) -> None:
    one = by_estimator[0][0]
    least = np.sqrt(np.mean([e.least for e in by_estimator[0]], axis=0))
    axes.fill_between(one.t, least, 1e-12, color=BOUND, alpha=0.12, lw=0.0)
    axes.plot(one.t, least, color=BOUND, lw=2.4, label="Cramér-Rao bound")
    for errors, colour in zip(by_estimator, cycle(COLOURS), strict=False):
        course = np.sqrt(np.mean([e.course for e in errors], axis=0))
        axes.plot(one.t, course, color=colour, lw=1.4, label=errors[0].estimator)
    finite = least[np.isfinite(least) & (least > 0.0)]
    if len(finite):
        axes.set_ylim(bottom=0.3 * float(finite.min()))
    axes.set(yscale="log", xlim=(one.t[0], one.t[-1]), ylabel=f"RMS error [{SCENARIOS[one.scenario].unit}]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


# ---- what is measured

_NAME = "it"
Difference = Callable[[Array, Array], Array]
Readings = list[list[tuple[str, Array]]]


@dataclass(frozen=True)
class BoundRun:
    """Run of a scenario, by name, seed and duration [s]."""

    scenario: str
    seed: int
    seconds: float


@dataclass(frozen=True)
class BoundErrors:
    """Errors of an estimator over the second half of a run, and over each piece of it, in the evaluated components."""

    scenario: str
    estimator: str
    squares: float  # sum of squared errors
    bounds: float  # sum of the bounds on them
    ok: float  # share of the estimates with the status OK
    cost: MeasuredTime  # [us] CPU time of an update, the median
    t: tuple[float, ...]  # [s] middles of the pieces
    course: tuple[float, ...]  # mean of the squared error over each
    least: tuple[float, ...]  # and of the bound on it, NaN where there is none


@dataclass(frozen=True, eq=False)
class _Recorded:
    mission: Any
    calls: Sequence[RecordedCall]
    bound: PosteriorBound
    difference: Difference  # (estimate, truth) -> the judged components of the error


def compared(run: BoundRun) -> list[BoundErrors]:
    """A job: errors of each estimator of the scenario over one run."""
    recorded = _RECORDERS[run.scenario](np.random.default_rng(run.seed), run.seconds)
    late = slice(len(recorded.calls) // 2, None)
    squared_bounds = np.square(recorded.bound.deviation[:, list(recorded.bound.judged)]).sum(axis=1)
    bounds = float(squared_bounds[late].sum())
    pieces = np.array_split(np.arange(len(recorded.calls)), min(PIECES, len(recorded.calls)))
    t = tuple(float(np.mean([recorded.calls[k].t for k in piece])) for piece in pieces)
    least = tuple(float(squared_bounds[piece].mean()) for piece in pieces)
    found = []
    for name in SCENARIOS[run.scenario].estimators:
        called, fields = TUNED.get(name, (name, {}))
        plugin = load("estimators", called)
        estimator = plugin.build(plugin.Config(**fields), recorded.mission)
        errors, statuses, costs = [], [], []
        for call in recorded.calls:
            began = time.process_time()
            estimate = estimator.update(call.t, call.measurements, call.command)
            costs.append(1e6 * (time.process_time() - began))
            errors.append(recorded.difference(estimate.x, call.truth))
            statuses.append(estimate.status is Status.OK)
        each = np.square(errors).sum(axis=1)
        squares, course = float(each[late].sum()), tuple(float(each[piece].mean()) for piece in pieces)
        ok = float(np.mean(statuses[late]))
        cost = MeasuredTime(np.median(costs))
        found.append(BoundErrors(run.scenario, name, squares, bounds, ok, cost, t, course, least))
    return found


def _ranges(rng: np.random.Generator, seconds: float) -> _Recorded:
    """Record a figure of eight in an ellipse with three sensors; the start is known roughly."""
    pose, deviation = np.array([0.6, -0.3, 0.8]), np.array([0.1, 0.1, 0.1])
    known = pose + deviation * rng.standard_normal(3)
    quality, odometry = RangeQuality(0.02, 0.01), OdometryQuality((0.05, 0.05), 0.02)
    mission = RangingMission(
        ellipse(3.763, math.sqrt(2.0)), (0.0, 0.5 * math.pi, -1.7), quality, odometry,
        KnownStart((float(known[0]), float(known[1]), float(known[2])), (0.1, 0.1, 0.1)),
    )  # fmt: skip
    scale, h = odometry.bias * rng.standard_normal(), mission.period
    truths, readings, inputs = [], [], []
    for k in range(round(seconds / h) + 1):
        exact, _ = mission.curve.ranges(pose, mission.alpha)
        noise = rng.standard_normal((2, mission.sensors))
        read = exact * (1.0 + quality.relative * noise[0]) + quality.absolute * noise[1]
        truths.append(pose)
        readings.append([("ranges", read)])
        u = np.array(figure_eight((k + 0.5) * h, 0.5, 8.0))
        inputs.append(u)
        if k:
            driven = (1.0 + scale) * inputs[-2] + np.array(odometry.noise) * rng.standard_normal(2)
            readings[-1].append(("odometry", driven))
        pose = mission.flow(pose, u, h)
    recording, calls = _logged(h, truths, readings, inputs)
    return _Recorded(
        mission, calls, ranging_bound(recording, _NAME, mission), lambda x, truth: mission.difference(x, truth)[:2]
    )


def _flight(rng: np.random.Generator, seconds: float) -> _Recorded:
    """Record a point mass that sways under gusts, with ten position fixes a second."""
    mission = FlightMission(
        HeightField(np.zeros((3, 3)), 5000.0), (4000.0, 4000.0, 900.0), (9000.0, 9000.0, 900.0), position_noise=3.0,
        gust=DeclaredGusts(0.5),
    )  # fmt: skip

    def read(x: Array, k: int) -> list[tuple[str, Array]]:
        return [("position", x[:3] + mission.position_noise * rng.standard_normal(3))] if k % 6 == 0 else []

    def command(t: float) -> Array:
        return np.array([4.0 * math.cos(0.5 * t), 3.0 * math.sin(0.7 * t), math.cos(1.1 * t)])

    truths, readings, inputs = _simulated(
        FlightModel.as_declared(mission), rng, seconds, mission.control_period, command, read
    )
    recording, calls = _logged(mission.control_period, [x[:6] for x in truths], readings, inputs)
    bound = flight_bound(recording, _NAME, mission)
    return _Recorded(mission, calls, bound, lambda x, truth: x[:3] - truth[:3])


def _missile(rng: np.random.Generator, seconds: float) -> _Recorded:
    """Record nearly level flight in a plane under gusts; the whole state is measured."""
    start = np.zeros(PLANAR.state_size)
    start[PLANAR.index("u")], start[PLANAR.index("z_e")] = 120.0, -300.0
    mission = MissileMission(
        tuple(start), Target((700.0, 0.0, 0.0)), CASES["SM"], PLANAR,
        noise=StateNoise(position=2.0, velocity=1.0, angle=0.02, rate=0.02), gust=GustStrength(300.0, 20.0),
    )  # fmt: skip
    weight, deviations = mission.body.mass * mission.body.gravity, mission.noise.deviations(PLANAR)

    def command(t: float) -> Array:
        forces = (400.0 * math.cos(t), -weight + 300.0 * math.sin(2.0 * t), 20.0 * math.cos(1.5 * t))
        return np.array(forces)

    def read(x: Array, k: int) -> list[tuple[str, Array]]:
        return [("full_state", x[: len(start)] + deviations * rng.standard_normal(len(start)))]

    truths, readings, inputs = _simulated(
        MissileModel.as_declared(mission), rng, seconds, mission.control_period, command, read
    )
    states = [x[: len(start)] for x in truths]
    recording, calls = _logged(mission.control_period, states, readings, inputs)
    recording.truths[_NAME] = PLANAR.to_joints(np.array(states))
    bound = missile_bound(recording, _NAME, mission)
    judged = list(bound.judged)
    return _Recorded(mission, calls, bound, lambda x, truth: x[judged] - truth[judged])


def _mechanism(rng: np.random.Generator, seconds: float) -> _Recorded:
    """Record an undisturbed arm with two joints under torques; its angles are measured with noise."""
    system = MechanismSystem(build_model("two-link", name="arm"))
    mission = LagrangianMission(system, PositionQuality(1e-3), 5e-3, speed_max=30.0)
    n, x = system.manifold.size, mission.start_state
    truths, readings, inputs = [], [], []
    for k in range(round(seconds / mission.period) + 1):
        t = k * mission.period
        truths.append(x)
        readings.append([("position", x[:n] + mission.reading.noise * rng.standard_normal(n))])
        inputs.append(np.array([math.sin(3.0 * t), 0.5 * math.cos(2.0 * t)]))
        x = mission.flow(x, inputs[-1], mission.period)
    recording, calls = _logged(mission.period, truths, readings, inputs)
    bound = lagrangian_bound(recording, _NAME, mission)
    return _Recorded(mission, calls, bound, lambda x, truth: x[n:] - truth[n:])


def _simulated(
    model: StagewiseModel,
    rng: np.random.Generator,
    seconds: float,
    h: float,
    command: Callable[[float], Array],
    read: Callable[[Array, int], list[tuple[str, Array]]],
) -> tuple[list[Array], Readings, list[Array]]:
    """Return states, readings and inputs of a model whose start and process noise are drawn."""
    started = model.start(None)
    assert started is not None
    x = started[0] + square_root(started[1]) @ rng.standard_normal(model.size)
    truths: list[Array] = []
    readings: Readings = []
    inputs: list[Array] = []
    for k in range(round(seconds / h) + 1):
        truths.append(x)
        readings.append(read(x, k))
        inputs.append(command(k * h))
        after, _, Q = model.transition(x, inputs[-1], h)
        x = after + square_root(Q) @ rng.standard_normal(model.size)
    return truths, readings, inputs


def _logged(
    h: float, truths: Sequence[Array], readings: Readings, inputs: Sequence[Array]
) -> tuple[Recording, list[RecordedCall]]:
    """Return the run with its bound, and with the calls of an estimator."""
    n = len(truths)
    kept: dict[str, Array] = {}
    calls = []
    for k, read in enumerate(readings):
        for name, value in read:
            kept.setdefault(name, np.full((n, len(value)), np.nan))[k] = value
        measurements = tuple(Measurement(name, k * h, value) for name, value in read)
        command = inputs[k - 1] if k else np.zeros_like(inputs[0])
        calls.append(RecordedCall(k * h, measurements, command, truths[k]))
    agent = AgentRecorder(_NAME, [], np.array(inputs), kept)
    t: Array = h * np.arange(n, dtype=np.float64)
    return Recording(t, {_NAME: np.array(truths)}, {_NAME: agent}, [], {_NAME: ()}, n), calls


_RECORDERS = {"ranges": _ranges, "flight": _flight, "missile": _missile, "mechanism": _mechanism}
