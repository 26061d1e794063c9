"""Figure D.4 with position and velocity errors: the observer of D.5 as printed and repaired, on three curvatures.

Theorem D.2 states that the observer converges. With the printed gains its position does, but its velocity does not.

In addition every estimator of body rates is run over the same noisy attitudes of a body in MuJoCo under torques. Two
quantities are measured: the error once all estimators have settled, and the time that they take from rest to the rate
of the body. Estimators called tuned are tuned for the first, by a sweep of one field on a run that is not reported.

The error is that of the thesis and of the run summaries: |Delta v|, after omega^ is transported to the attitude of the
body. The error of a user of the rates, |omega^ - omega|, each in the axes of its attitude, is reported too: it also
contains |omega| times the error of the attitude.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.estimators.riemannian.contraction import ContinuousObserver, Instant
from mathnavi.estimators.riemannian.gains import IntrinsicGains
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, hyperbolic_space, sphere
from mathnavi.models.manifold.mission import POSITION, LagrangianMission
from mathnavi.models.manifold.systems import PointSystem, chart, linear, printed
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.lagrangian import VelocityErrors, errors_of
from mathnavi.sim.metrics.tuning import RecordedCall, Tuning, recorded_calls, replayed, spread, tuned
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Band
from mathnavi.sim.scenarios.arm_velocity import VEHICLE as MECHANISM
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.sphere_observer import VEHICLE, config_mission, rigid_body_plant
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import HALO, annotate, styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult, median
from mathnavi.studies.riemannian.identities import residuals

SPACES = ("S^3", "H^2")
CART = "cart and pendulum"
GAINS: Mapping[str, Mapping[str, Any]] = {
    "printed": {"gains": "printed"},
    "repaired": {"bandwidth": math.sqrt(3.0), "damping": 0.5 * math.sqrt(3.0)},  # A = B = 3
}
DIMENSIONS, CURVATURES = (2, 3, 5), (1.0, -1.0)
ANGLES, RATES = np.array([1.0, 0.7, 2.0]), np.array([2.25, 1.25, 4.0])  # x(0) and v(0) of D.5
BOWL = 4.0  # [1/s^2] c of the potential on H^2
H2_START, H2_VELOCITY = (0.8, 0.3), (0.9, 2.4)  # in normal coordinates about the origin, and in the frame there
KEPT = 0.01  # [s] between what is kept of a run
STEPS = {"printed": 2e-4, "repaired": 1e-3}  # [s]; the printed A is up to 9487 per second, of which RK4 bears 2.78
FASTEST = 10.0  # [rad/s] of the free body in MuJoCo
GONE = 0.01  # of the error at the start

IDENTICAL = 1e-7  # largest residual of an identity
REPAIRED_AT = (2.9, 3.1)  # [s]
LEFT = 0.98  # of the velocity error at the start, with the printed gains after 30 s

TORQUES = {"planner.amplitude": (0.3, 0.2, 0.25), "planner.frequency": 2.0}  # [N m], [rad/s]
TUNED_ON = 1000  # the seed of the run for it
SETTLED_FROM = 1.0 / 3.0  # of a run, from when on errors count
THINNED = 5  # readings from one |Delta v|_g to the next
SPEED = 6.0  # [rad/s] of the body at the start
SPEEDS = (6.0, 25.0, 60.0)  # [rad/s] from which settling is timed
SETTLING = 2.0  # [s] for which it is, at most

OBSERVER, TUNED = "observer", "observer, tuned"
HIGH_GAIN, HIGH_GAIN_TUNED, EKF, UKF = "high gain", "high gain, tuned", "EKF, tuned", "UKF, tuned"
DIFFERENCES, BUTTERWORTH = "differences", "Butterworth, tuned"
OMEGA = 10.0  # [1/s] of the observer of the target, and of high gain beside it
CUTOFFS = (0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 9.0, 12.0, 15.0, 20.0, 30.0, 50.0)  # [Hz]
BANDWIDTHS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 50.0)  # [1/s]
DENSITIES = (1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 1.0)  # [rad/s^1.5]

FIXED: Mapping[str, tuple[str, str, float]] = {
    OBSERVER: ("riemannian_observer", "bandwidth", OMEGA),
    HIGH_GAIN: ("high_gain", "bandwidth", OMEGA),
    "Butterworth 20 Hz": ("filtered_differences", "cutoff", 20.0),
    "Butterworth 5 Hz": ("filtered_differences", "cutoff", 5.0),
    DIFFERENCES: ("filtered_differences", "cutoff", 0.0),
}
"""plug-in, field and its value of the estimators in the target, by name"""
SWEPT: Mapping[str, tuple[str, str, tuple[float, ...]]] = {
    UKF: ("lagrangian_ukf", "acceleration", DENSITIES),
    EKF: ("lagrangian_ekf", "acceleration", DENSITIES),
    TUNED: ("riemannian_observer", "bandwidth", BANDWIDTHS),
    HIGH_GAIN_TUNED: ("high_gain", "bandwidth", BANDWIDTHS),
    BUTTERWORTH: ("filtered_differences", "cutoff", CUTOFFS),
}
"""plug-in, swept field and its values, by name of the estimator"""
SETTLED = (OBSERVER, TUNED, HIGH_GAIN, HIGH_GAIN_TUNED, EKF, UKF)  # those of which settling is timed
NAMES = (*SETTLED, BUTTERWORTH, "Butterworth 20 Hz", "Butterworth 5 Hz", DIFFERENCES)
BODY_RATES = slice(4, 7)  # of the state

COLOURS = {"printed": "#c2183b", "repaired": "#0d5fa8"}
COMPONENTS = ("#0d5fa8", "#e07b00", "#0f9472")
TITLES = {"S^3": "$S^3$", "H^2": "$H^2$", CART: "cart and pendulum, flat"}
LEAST = 1e-7  # that is drawn
LEAST_ERROR = 1e-4  # [rad/s] where the bars of (i) begin
LONGEST = 10.0  # [s] of (a) to (f)
SHOWN = 4.0  # [s] of (g) and (h)


@configuration
class SphereConfig:
    """Sample sizes: runs."""

    points: Count = 1000
    """number of pairs of points at which the identities are tested, for each dimension and curvature"""
    seconds: Count = 30
    """duration of the runs in continuous time [s]"""
    noisy: Count = 8
    """number of runs with noise"""
    fast: Count = len(SPEEDS)
    """largest number of speeds at which the settling time is measured"""
    values: Count = len(CUTOFFS)
    """largest number of values of a sweep, spread over its range"""
    bodies: Count = 20
    """number of free bodies in MuJoCo"""


class Sphere:
    """The observer of D.5 as printed and repaired, on S^3, on H^2 and on the cart and pendulum (Figure D.4)."""

    Config = SphereConfig
    quick = SphereConfig(points=20, seconds=6, noisy=1, fast=1, values=4, bodies=2)
    title = "Riemannian observers: Figure D.4, as printed and repaired"
    on_terrain = False

    @staticmethod
    def run(config: SphereConfig, setup: Setup) -> StudyResult:
        e = _results(config, setup)
        return StudyResult(
            summary=(
                "S^3: the data, the force and the gains of D.5, xi(0) = x(0) and eta(0) = 0. H^2: a point in a bowl, "
                "U = 4 p_0. Cart and pendulum: in MuJoCo, exact positions at 1 kHz. Printed: A = 3 (1 + S) / sqrt(S + "
                "1e-7), B = 3; repaired: A = B = 3; C = -1.",
                "The noisy runs are of a body in MuJoCo under torques, attitudes at 1 kHz with 0.01 rad of noise about "
                "every axis, the observer with omega = 10; errors of the body rate once a third of a run is over, over "
                "the same readings for every estimator. Tuned: the best of a sweep of one field on another run, of "
                f"seed {TUNED_ON}. In stationary noise and with an exact model a tuned EKF wins: it is given how large "
                "the noise is, and its gain falls as it learns. It also settles first, from any rate. The observer is "
                "given nothing of the noise, and settles in 6.6 / omega where |v|, half the body rate, is less than "
                "about 3 omega; high gain of the same omega does so too, and more surely at the greatest rate.",
            ),
            rows=_rows(e),
            tables=_tables(e),
            figure=_figure(e),
            caption="(a) to (f) Distance between x and xi, and length of v - v^, with the gains as printed and "
            "repaired; dashed: 1 % of the velocity at the start. (g) v on S^3 and its estimate by the observer, "
            "three of four ambient components (Figure D.4). (h) Lyapunov functions along the repaired run. (i) Body "
            "rates from noisy attitudes; blue: the observer.",
            claims=_claims(e),
        )


@dataclass(frozen=True)
class SphereResults:
    """Results from which rows, tables, claims and figure are made."""

    runs: Mapping[tuple[str, str], Mapping[str, Array]]  # by space and gains
    residuals: Mapping[str, float]  # by equation, the largest
    tried: int  # pairs of points
    deviation: Array  # [rad] of free bodies in MuJoCo from their geodesics
    tunings: Mapping[str, Tuning]  # by estimator
    errors: Mapping[str, Band]  # |Delta v| as a body rate [rad/s] by estimator
    plain: Mapping[str, Band]  # |omega^ - omega| [rad/s]
    settled: Mapping[str, Mapping[float, Sequence[float]]]  # [s] by estimator and speed, a value for each seed

    def left(self, space: str, gains: str) -> float:
        """Return the velocity error at the end over that at the start."""
        error = self.runs[space, gains]["speed_error"]
        return float(error[-1] / error[0])

    def gone_at(self, space: str, gains: str) -> float:
        """Return the time [s] from which the velocity error is below 1 % of that at the start."""
        run = self.runs[space, gains]
        above = np.flatnonzero(run["speed_error"] > GONE * run["speed_error"][0])
        return float(run["t"][above[-1]])

    def times(self, name: str) -> float:
        """Return the error of an estimator over that of the observer."""
        return self.errors[name].median / self.errors[OBSERVER].median

    def setting(self, name: str) -> str:
        """Return the value of an estimator's field as text, marked if tuning ended at the edge of the sweep."""
        if name in FIXED:
            return f"{FIXED[name][2]:g}"
        tuning = self.tunings[name]
        return f"{tuning.best:g}{', at the edge' if tuning.at_edge else ''}"


def _results(config: SphereConfig, setup: Setup) -> SphereResults:
    """Run the observer without noise, tune every estimator, and run all with noise and at several speeds."""
    jobs, longest = Jobs(), min(6.0, 0.5 * config.seconds)
    jobs.add("tuned", swept, SWEPT, seconds=longest, values=config.values)
    for gains in GAINS:
        for space in SPACES:
            jobs.add((space, gains), flown, [space], gains=gains, seconds=config.seconds)
    for n in DIMENSIONS:
        for kappa in CURVATURES:
            jobs.add("identities", residuals, range(config.points), n=n, kappa=kappa)
    jobs.add("bodies", distance_to_geodesic, range(config.bodies))
    done = jobs.done(setup)
    carts = setup.fly_each({(CART, gains): cart_pendulum(gains, min(10.0, config.seconds)) for gains in GAINS})
    tunings = dict(zip(SWEPT, done["tuned"], strict=True))
    settings = {name: FIXED[name][2] if name in FIXED else tunings[name].best for name in NAMES}
    jobs, speeds = Jobs(), SPEEDS[: config.fast]
    jobs.add("errors", errors, range(config.noisy), seconds=longest, settings=settings)
    for speed in speeds:
        runs = range((config.noisy + 1) // 2)
        jobs.add(speed, settling, runs, seconds=min(SETTLING, longest), speed=speed, settings=settings)
    noisy = jobs.done(setup)
    plain, carried = (
        {name: median(np.array([one[name][k] for one in noisy["errors"]])) for name in NAMES} for k in (0, 1)
    )
    return SphereResults(
        runs={(space, gains): done[space, gains][0] for space in SPACES for gains in GAINS}
        | {
            key: {name: np.array(record.summary[name]) for name in ("t", "theta", "speed_error")}
            for key, record in carts.items()
        },
        residuals={name: max(one[name] for one in done["identities"]) for name in done["identities"][0]},
        tried=len(done["identities"]),
        deviation=np.array(done["bodies"]),
        tunings=tunings,
        errors=carried,
        plain=plain,
        settled={name: {speed: [one[name] for one in noisy[speed]] for speed in speeds} for name in SETTLED},
    )


def _rows(e: SphereResults) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = [
        {"what": "identity", "equation": name, "largest_residual": value} for name, value in e.residuals.items()
    ]
    rows += [
        {"what": "run", "space": space, "gains": gains, "t_s": t, "distance": theta, "velocity_error": error}
        for (space, gains), run in e.runs.items()
        for t, theta, error in zip(run["t"][::10], run["theta"][::10], run["speed_error"][::10], strict=True)
    ]
    rows += [
        {"what": "noise", "estimator": name, "rms_rad_s": band.median, "plain_rms_rad_s": e.plain[name].median}
        for name, band in e.errors.items()
    ]
    rows += [
        {"what": "tuning", "estimator": name, "setting": value, "rms_rad_s": error}
        for name, t in e.tunings.items()
        for value, error in zip(t.grid, t.errors, strict=True)
    ]
    rows += [
        {"what": "settling", "estimator": name, "speed_rad_s": speed, "t_s": at}
        for name, by_speed in e.settled.items()
        for speed, times in by_speed.items()
        for at in times
    ]
    return rows


def _tables(e: SphereResults) -> tuple[Table, Table, Table]:
    """Return the tables of identities, of errors once all have settled, and of settling times."""
    setting = "omega [1/s], cutoff [Hz], q [rad/s^1.5]"
    speeds = tuple(f"{speed:g} rad/s" for speed in e.settled[OBSERVER])
    return (
        Table(
            "Identities: largest residual", ("equation", "left side less right"),
            [(name, f"{value:.1e}") for name, value in e.residuals.items()],
        ),
        Table(
            "Body rates from noisy attitudes",
            ("estimator", setting, "error [rad/s]", "times the observer's", "|omega^ - omega| [rad/s]"),
            [(n, e.setting(n), e.errors[n].text(), f"{e.times(n):.3g}", f"{e.plain[n].median:.3g}") for n in NAMES],
        ),
        Table(
            "From rest to the body's rate: time until 1 % [s]", ("estimator", *speeds),
            [(name, *map(_settled, by_speed.values())) for name, by_speed in e.settled.items()],
        ),
    )  # fmt: skip


def _settled(times: Sequence[float]) -> str:
    found = [t for t in times if np.isfinite(t)]
    if len(found) == len(times):
        return median(np.array(found)).text()
    many = f"{len(found)} of {len(times)} in the run"
    return many if not found else f"{many}, median {float(np.median(found)):.3g}"


def _claims(e: SphereResults) -> list[Claim]:
    """Evaluate every claim of the study."""
    true = {name: value for name, value in e.residuals.items() if "printed" not in name}
    worst = max(true, key=lambda name: true[name])
    seconds = float(e.runs["S^3", "printed"]["t"][-1])
    spaces = (*SPACES, CART)
    thetas = ", ".join(f"{space} {e.runs[space, 'printed']['theta'][-1]:.1g}" for space in spaces)
    left = ", ".join(f"{space} {e.left(space, 'printed'):.1%}" for space in spaces)
    gone = {space: e.gone_at(space, "repaired") for space in spaces}
    better = min((name for name in FIXED if "Butterworth" in name), key=lambda name: e.errors[name].median)
    ratios = e.times(DIFFERENCES), e.times(better)
    rivals = ", ".join(
        f"{name.removesuffix(', tuned')} {e.errors[name].median:.4f} ({1.0 / e.times(name):.2g} times better)"
        for name in (EKF, UKF, HIGH_GAIN_TUNED, TUNED)
    )
    plain = e.plain[DIFFERENCES].median / e.plain[OBSERVER].median
    return [
        Claim(
            "riemannian.identities", "target", "The identities of the distance and of parallel transport hold.",
            "(D.3) to (D.19), (D.25)", f"at random points of S^n and H^n, n = 2, 3, 5, to {IDENTICAL:g}",
            f"at {e.tried} pairs of points; worst {worst}: {true[worst]:.1e}",
            max(true.values()) <= IDENTICAL,
        ),
        Claim(
            "riemannian.printed-gain", "target", "With the printed gains the velocity error stays.", "D.5",
            f"at least {LEFT:.0%} of it left after 30 s", f"after {seconds:g} s: {e.left('S^3', 'printed'):.2%}",
            e.left("S^3", "printed") >= LEFT,
        ),
        Claim(
            "riemannian.repaired-gain", "target", "With constant gains the velocity error goes.", "D.4.4, D.5",
            f"A = B = 3: under 1 % from {REPAIRED_AT[0]:g} to {REPAIRED_AT[1]:g} s",
            ", ".join(f"{space} {at:.2f} s" for space, at in gone.items()),
            REPAIRED_AT[0] <= gone["S^3"] <= REPAIRED_AT[1],
        ),
        Claim(
            "riemannian.mujoco", "target", "A ball joint in MuJoCo moves along the geodesics of S^3.", "D.5",
            "RK4, 5 s at 10 rad/s: at most 1e-9 rad off",
            f"{e.deviation.max():.1e} rad at most, of {len(e.deviation)} bodies",
            bool(e.deviation.max() <= 1e-9),
        ),
        Claim(
            "riemannian.noise", "target", "Noisy attitudes give the body rate better by the observer.", "D.1",
            "error at least 2500 times below that of differences, and 10 times below the better Butterworth filter's",
            f"{ratios[0]:.0f} times, and {ratios[1]:.0f} times below {better}: {e.errors[OBSERVER].median:.4f} rad/s; "
            f"{e.times(BUTTERWORTH):.0f} times below the best of a sweep of cutoffs ({e.setting(BUTTERWORTH)} Hz); "
            f"with what the attitude's error adds, |omega^ - omega|, {e.plain[OBSERVER].median:.4f} rad/s, "
            f"{plain:.0f} times below differences. Tuned on another run: {rivals}",
            ratios[0] >= 2500.0 and ratios[1] >= 10.0,
        ),
        Claim(
            "D.converges", "printed", "The observer converges from xi = x, eta = 0.", "Theorem D.2, Figure D.4",
            "position and velocity error go",
            f"distance after {seconds:g} s (the cart's 10 s): {thetas}; but of the velocity error is left: {left}",
            all(e.left(space, "printed") < GONE for space in SPACES),
        ),
        Claim(
            "D.transport-derivative", "printed", "K_|k K = Upsilon (S^j g_km - delta^j_m S_k).", "(D.19)",
            f"to {IDENTICAL:g}",
            f"off by up to {e.residuals['D.19 printed']:.2g}; with delta^j_k S_m {e.residuals['D.19']:.1e}",
            e.residuals["D.19 printed"] <= IDENTICAL,
        ),
        Claim(
            "D.transport-second", "printed", "K_|beta|gamma|alpha S^alpha = R K S + K_|alpha S^alpha_|gamma.", "(D.12)",
            f"to {IDENTICAL:g}",
            f"off by up to {e.residuals['D.12 printed']:.2g}; with a minus {e.residuals['D.12']:.1e}",
            e.residuals["D.12 printed"] <= IDENTICAL,
        ),
        Claim(
            "D.lyapunov", "printed", "V' = -2 A B S but for a cubic term, which the printed (D.19) makes vanish.",
            "(D.25)", f"to {IDENTICAL:g}",
            f"off by up to {e.residuals['D.25 printed']:.2g} without it; with it {e.residuals['D.25']:.1e}",
            e.residuals["D.25 printed"] <= IDENTICAL,
        ),
    ]  # fmt: skip


def _figure(e: SphereResults) -> Figure:
    """Draw the figure of the study."""
    with styled_figure((13.0, 10.5)) as page:
        axes = page.subplots(3, 3)
        for column, space in enumerate(TITLES):
            runs = {gains: e.runs[space, gains] for gains in COLOURS}
            _draw_errors(axes[0, column], runs, "theta", f"({'abc'[column]}) {TITLES[space]}: position")
            _draw_errors(axes[1, column], runs, "speed_error", f"({'def'[column]}) {TITLES[space]}: velocity")
        axes[0, 0].set_ylabel(r"dist$(x, \xi)$")
        axes[1, 0].set_ylabel(r"$|v - \hat v|_g$")
        _draw_components(axes[2, 0], e)
        _draw_lyapunov(axes[2, 1], e.runs["S^3", "repaired"])
        _draw_noise(axes[2, 2], e.errors)
    return page


def _draw_errors(axes: Axes, runs: Mapping[str, Mapping[str, Array]], name: str, title: str) -> None:
    axes.set_title(title)
    for gains, run in runs.items():
        values = np.maximum(run[name], LEAST)
        axes.plot(run["t"], values, color=COLOURS[gains], lw=1.8)
        early = run["t"] <= LONGEST
        k = int((0.65 if gains == "printed" else 0.25) * (early.sum() - 1))
        annotate(axes, gains, (run["t"][k], values[k]), (6, -13 if gains == "printed" else 2), color=COLOURS[gains],
                 weight="bold", path_effects=HALO, ha="left")  # fmt: skip
    if name == "speed_error":
        axes.axhline(GONE * runs["printed"][name][0], color=INK, lw=0.8, ls=(0, (4, 3)))
    axes.set(yscale="log", xlabel="time [s]",
             xlim=(0.0, min(LONGEST, max(float(run["t"][-1]) for run in runs.values()))),
             ylim=(0.3 * LEAST, None))  # fmt: skip


def _draw_components(axes: Axes, e: SphereResults) -> None:
    axes.set_title("(g) $v$ on $S^3$, and $\\hat v$")
    truth = e.runs["S^3", "repaired"]
    early = truth["t"] <= SHOWN
    for k, colour in enumerate(COMPONENTS):
        axes.plot(truth["t"][early], truth["v"][early, k], color=colour, lw=2.2, alpha=0.45)
        axes.plot(truth["t"][early], truth["v_hat"][early, k], color=colour, lw=1.2)
        printed = e.runs["S^3", "printed"]
        soon = printed["t"] <= SHOWN
        axes.plot(printed["t"][soon], printed["v_hat"][soon, k], color=colour, lw=1.0, ls=(0, (2, 2)))
    axes.set(xlabel="time [s]; pale: $v$, solid: repaired, dotted: printed", xlim=(0.0, SHOWN))


def _draw_lyapunov(axes: Axes, run: Mapping[str, Array]) -> None:
    axes.set_title("(h) Lyapunov functions, repaired")
    B = 3.0
    kinetic, S, product = run["lyapunov"].T
    V, W = kinetic + B * S, kinetic + 3.0 * B * S - np.sqrt(B) * product
    early = run["t"] <= SHOWN
    for name, values, colour, at in (("$V$", V, "#e07b00", 100), ("$W$", W, "#0d5fa8", 250)):
        axes.plot(run["t"][early], values[early], color=colour, lw=1.8)
        at = min(at, int(early.sum()) - 1)
        annotate(axes, name, (run["t"][early][at], values[early][at]), (6, 6), color=colour, weight="bold", size=11.0)
    axes.set(yscale="log", xlabel="time [s]", xlim=(0.0, SHOWN))


def _draw_noise(axes: Axes, errors: Mapping[str, Band]) -> None:
    axes.set_title("(i) noisy attitudes at 1 kHz: body rate")
    names = list(errors)[::-1]
    for k, name in enumerate(names):
        band, colour = errors[name], "#0d5fa8" if name.startswith("observer") else "#6b7a8c"
        axes.plot([LEAST_ERROR, band.median], [k, k], color=colour, lw=7.0, solid_capstyle="butt", alpha=0.85)
        annotate(axes, f"{band.median:.3g} rad/s", (band.median, k), (6, 0), va="center", color=colour, weight="bold")
    axes.set_yticks(range(len(names)), names)
    axes.set(xscale="log", xlim=(LEAST_ERROR, 100.0 * max(band.median for band in errors.values())),
             ylim=(-0.6, len(names) - 0.4))  # fmt: skip
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("root mean square error [rad/s]")


def flown(space_name: str, gains: str, seconds: float) -> dict[str, Array]:
    """A job: a run integrated in continuous time.

    It has, every ``KEPT`` s, t [s], theta, |Delta v|, v and v^ (ambient), and (|Delta v|^2 / 2, S, <s, Delta v>).
    """
    system, start = _system(space_name)
    space, n = system.manifold, system.manifold.size
    fields = {"bandwidth": 1.0, "damping": 1.0, "gains": "constant", **GAINS[gains]}
    intrinsic = IntrinsicGains(fields["bandwidth"], fields["damping"], fields["gains"], "minus-one", space.kappa)
    observer = ContinuousObserver(space, intrinsic, start[:n], np.zeros(n))
    h, none = STEPS[gains], np.zeros(n)
    every = round(KEPT / h)
    rows: dict[str, list[Any]] = {name: [] for name in ("t", "theta", "speed_error", "v", "v_hat", "lyapunov")}
    x = start
    for k in range(round(seconds / h) + 1):
        if k % every == 0:
            theta, _, error, lyapunov = errors_of(space, x, np.concatenate([observer.xi, observer.eta]))
            v_hat = space.transport(observer.xi, x[:n], observer.eta)
            values = (k * h, theta, error, x[n:], v_hat, lyapunov)
            for name, value in zip(rows, values, strict=True):
                rows[name].append(value)
        middle, _ = system.reach(x, none, 0.5 * h)
        end, _ = system.reach(middle, none, 0.5 * h)
        observer.step(h, _instant(system, x), _instant(system, middle), _instant(system, end))
        x = end
    return {name: np.array(values) for name, values in rows.items()}


def _system(space: str) -> tuple[PointSystem, Array]:
    """Return the system and its state at the start."""
    if space == "S^3":
        system = PointSystem(sphere(3), printed)
        point, slope = chart(ANGLES)
        return system, system.state(point, slope @ RATES)
    plane: ConstantCurvature = hyperbolic_space(2)
    point = plane.point(plane.origin, np.array(H2_START))
    system = PointSystem(plane, linear(BOWL, 0))
    return system, system.state(point, plane.vector(point, np.array(H2_VELOCITY)))


def _instant(system: PointSystem, state: Array) -> Instant:
    n = system.manifold.size
    x = state[:n]
    return x, system.force(x, state[n:], np.zeros(n))


# ---- the cart and pendulum


def cart_pendulum(gains: str, seconds: float) -> Trial:
    """Return the trial of the cart and pendulum in MuJoCo, released at an angle, with exact encoders at 1 kHz."""
    fields = {
        "mechanism": "cart-pendulum", "reading.resolution": 0, "duration": seconds, "settled": 0.0,
        "start": (0.0, 2.0, 0.4, 3.0), **{f"estimator.{name}": value for name, value in GAINS[gains].items()},
    }  # fmt: skip
    return trial("arm-velocity", 0, controller="input_signal", fields=fields, measure=f"{__name__}:mechanism_errors")


def mechanism_errors(outcome: RunData) -> dict[str, Any]:
    """A measure: position and velocity errors every ``KEPT`` s."""
    manifold = MechanismSystem(build_model(outcome.config["fields"]["mechanism"], name=MECHANISM)).manifold
    errors = VelocityErrors.from_recording(outcome.recording, MECHANISM, manifold)
    every = max(1, round(KEPT / float(errors.t[1] - errors.t[0])))
    kept = {"t": errors.t, "theta": errors.position, "speed_error": errors.norm}
    return {name: values[::every].tolist() for name, values in kept.items()}


# ---- MuJoCo's ball joint


def distance_to_geodesic(seed: int) -> float:
    """A job: largest angle [rad] over 5 s between a free body in MuJoCo and the geodesic on which it starts."""
    rng, attitude = np.random.default_rng(seed), Attitude()
    start, axis = sphere(3).draw(rng), rng.standard_normal(3)
    omega = FASTEST * axis / np.linalg.norm(axis)
    plant = rigid_body_plant("body", np.concatenate([start, omega]), (), 0.05, rng)
    worst = 0.0
    for _ in range(50):
        plant.step({}, 100)
        worst = max(worst, 2.0 * attitude.distance(plant.state("body")[:4], attitude.exp(start, plant.t * omega)))
    return worst


# ---- noisy attitudes of a body in MuJoCo under torques


def recorded(seed: int, seconds: float, speed: float = SPEED) -> tuple[LagrangianMission, list[RecordedCall]]:
    """Record attitudes at 1 kHz with 0.01 rad of noise about every axis, as the mission and the calls of an estimator.

    The torques do not depend on an estimate.
    """
    fields: dict[str, Any] = {
        "duration": seconds, "settled": 0.0, "speed": speed, "speed_max": max(100.0, 1.5 * speed), **TORQUES
    }  # fmt: skip
    flight = trial("sphere-observer", seed, estimator="filtered_differences", fields=fields)
    return config_mission(flight.spec.config), recorded_calls(flight.flown().recording, VEHICLE, POSITION)


@cache
def _tuning_run(seconds: float) -> tuple[LagrangianMission, list[RecordedCall]]:
    return recorded(TUNED_ON, seconds)


def swept(name: str, seconds: float, values: int) -> Tuning:
    """A job: errors of an estimator by the value of its field, at most ``values`` of them, on the tuning run."""
    plugin_name, field, grid = SWEPT[name]
    plugin = load("estimators", plugin_name)
    mission, calls = _tuning_run(seconds)
    chosen, begin = spread(grid, values), SETTLED_FROM * seconds
    return tuned(plugin, plugin.Config(), mission, calls, field, chosen, BODY_RATES, begin)


def errors(seed: int, seconds: float, settings: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """A job: by estimator RMS |omega^ - omega| [rad/s] and, as a body rate, |Delta v|_g [rad/s], once settled."""
    mission, calls = recorded(seed, seconds)
    first = round(SETTLED_FROM * len(calls))
    found = {}
    for name, value in settings.items():
        estimator = _built(name, value, mission)
        x = [estimator.update(call.t, call.measurements, call.command).x for call in calls]
        pairs = list(zip(x, calls, strict=True))[first:]
        plain = [a[BODY_RATES] - call.truth[BODY_RATES] for a, call in pairs]
        carried = [errors_of(mission.system.manifold, call.truth, a)[1] for a, call in pairs[::THINNED]]
        found[name] = _length_rms(plain), _length_rms(carried)
    return found


def settling(seed: int, seconds: float, speed: float, settings: Mapping[str, float]) -> dict[str, float]:
    """A job: by estimator, time [s] from which the error stays below 1 % of that at the start; NaN if it does not."""
    mission, calls = recorded(seed, seconds, speed)
    found = {
        name: replayed(_built(name, settings[name], mission), calls, BODY_RATES).below_from(GONE * speed)
        for name in SETTLED
    }
    return {name: np.nan if at is None else at for name, at in found.items()}


def _built(name: str, value: float, mission: LagrangianMission) -> Any:
    plugin_name, field, _ = FIXED.get(name) or SWEPT[name]
    plugin = load("estimators", plugin_name)
    return plugin.build(plugin.Config(**{field: value}), mission)


def _length_rms(errors: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1))))
