"""The Introduction's examples of observers (thesis 2.4, 2.5), run and compared with its statements.

Example 2.1 is observable and has no smooth observer; Example 2.2 has an observer and is not observable. (2.3) yields
linear error dynamics in suitable coordinates, (2.4) the same in the original ones, if its sign is corrected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from scipy.linalg import expm

from mathnavi.estimators.textbook.observers import Immersion
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.library import EXAMPLE_2_1, EXAMPLE_2_2, KRENER_ISIDORI, SYSTEMS, error_dynamics
from mathnavi.models.textbook.maps import of_numbers
from mathnavi.models.textbook.system import System
from mathnavi.renders.figures import BOUND, INK
from mathnavi.renders.study_report import Table
from mathnavi.renders.textbook.panel import ESTIMATE, TRUTH
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.textbook import VEHICLE
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult

SCENARIO = "textbook-observer"
OWN = {"duration": 5.0, "start_error": (1.0, 0.4, 1.0)}  # of the runs of Example 2.2
POLES = (-2.0, -3.0)
ESCAPING = (0.1, -0.5, 0.0)  # of Example 2.2 under u = sin t
BOUNDED = (-5.0, -2.0, 0.0)  # from where it does not escape under any of the inputs
LEAST, LARGEST = -0.75, 6.25  # alpha and beta of the map
INPUTS = {"u = 0": (0.0, 0.0), "u = -0.2": (-0.2, 0.0), "u = sin t": (0.0, 1.0), "u = 2 sin t": (0.0, 2.0)}
FORMS = ("printed", "corrected", "z")
SHOWN = {"escape": 1, "2.3": 1, "kazantzis-kravaris, printed": 3, "kazantzis-kravaris, corrected": 3}  # runs by kind
KEPT = ("deviation", "exponent_per_s", "error_ratio", "error_start", "error_end", "escaped", "escape_time_s")
DRAWN = {"krener-isidori": 1.5, "kazantzis-kravaris": 0.3}  # largest error of each state at the start
EXACT, OF_SERIES = 1e-5, 5e-3  # of the largest error, from which an error may differ from its equation
STARTS = (-0.8, -0.3, 0.3, 0.8)  # x_2 of Example 2.1, beside x_1 = 0.2
SHADES = ("#08519c", "#3182bd", "#e6842a", "#b3361f")
NAMED = ((0.36, -26), (1.2, -24), (1.2, 12), (0.35, 18))  # (time [s], points up) of their names under u = 1
UNTIL = 1.5  # [s]
FLOOR = 1e-9  # of an error that is drawn
UNEXCITED = 1e-9  # of the largest mode at the start
Rows = Sequence[Mapping[str, Any]]
Runs = Mapping[tuple[str, int], RunData]  # by kind and number


@configuration
class IntroductionExamplesConfig:
    """Sample sizes: runs."""

    grid: Count = 15
    """number of values of alpha, and of beta"""
    starts: Count = 25
    """number of drawn start errors for each observer of 2.4"""
    pairs: Count = 200
    """number of pairs of initial points of Example 2.1"""


class IntroductionExamples:
    """Examples 2.1 and 2.2, linear error dynamics (2.3), and equation (2.4) printed and corrected."""

    Config = IntroductionExamplesConfig
    quick = IntroductionExamplesConfig(grid=5, starts=3, pairs=40)
    title = "The Introduction's examples of observers"
    on_terrain = False

    @staticmethod
    def run(config: IntroductionExamplesConfig, setup: Setup) -> StudyResult:
        gains = np.linspace(LEAST, LARGEST, config.grid)
        pairs = [(alpha, beta) for alpha in gains for beta in gains]
        asked: dict[str, list[Trial]] = {
            "map": [_of_example_2_2({"estimator.alpha": alpha, "estimator.beta": beta}) for alpha, beta in pairs],
            "inputs": [_of_example_2_2({"start": BOUNDED, **_signal(*values)}) for values in INPUTS.values()],
            "escape": [_of_example_2_2({"start": ESCAPING})],
            "2.3": [_drawn("krener-isidori", "output_injection", {}, k) for k in range(config.starts)],
        }
        for system in DRAWN:
            for form in FORMS:
                fields = {"estimator.form": form}
                asked[f"{system}, {form}"] = [
                    _drawn(system, "kazantzis_kravaris", fields, k) for k in range(config.starts)
                ]
        rows = []
        for kind, records in setup.fly_groups(asked).items():
            for k, record in enumerate(records):
                alpha, beta = pairs[k] if kind == "map" else (None, None)
                kept = {name: record.summary.get(name) for name in KEPT}
                rows.append({"kind": kind, "run": k, "alpha": alpha, "beta": beta, **kept})
        (apart,) = setup.compute(output_separation, [config.pairs])
        shown = {(kind, k): one for kind, few in SHOWN.items() for k, one in enumerate(asked[kind][:few])}
        return StudyResult(
            summary=(
                "Every figure is of a run in the loop: the observers see readings a hundred times a second and no "
                "more, and follow their equations over the polynomial through the last four of them.",
            ),
            rows=rows,
            tables=(_coordinates(rows), _inputs(rows)),
            figure=_figure(rows, setup.flown(shown)),
            caption="(a) Example 2.1 from four initial points that read the same at first. (b) Example 2.2 under sin "
            "t, until it escapes. (c) Exponent of its error over (alpha, beta): measured, and as lines the "
            "real part of the slower root. (d) Van der Pol's oscillator and its observer, and the error in the "
            "coordinates of (2.3). (e) Equation (2.4) from three starts, as printed and with its sign put right.",
            claims=_claims(rows, apart),
        )


def _column(rows: Rows, name: str, *kinds: str) -> Array:
    """Return a figure (n,) of the runs of some kinds, NaN for runs that lack it."""
    return np.array([row[name] for kind in kinds for row in rows if row["kind"] == kind], dtype=np.float64)


def _coordinates(rows: Rows) -> Table:
    columns = ("observer", "starts", "error at the end over that at the start, median", "largest",
               "exponent, median [1/s]", "off its equation, largest")  # fmt: skip
    cells = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        if kind in ("map", "inputs", "escape"):
            continue
        ratio, exponent, deviation = (
            _column(rows, name, kind) for name in ("error_ratio", "exponent_per_s", "deviation")
        )
        cells.append(
            ("krener-isidori, (2.3)" if kind == "2.3" else kind, str(len(ratio)), f"{np.median(ratio):.2g}",
             f"{ratio.max():.2g}", f"{np.median(exponent):.2f}", f"{deviation.max():.1e}")
        )  # fmt: skip
    return Table(f"Observers in the coordinates of 2.4 and in the original ones, poles {POLES[0]:g}, {POLES[1]:g}",
                 columns, cells)  # fmt: skip


def _inputs(rows: Rows) -> Table:
    columns = ("input", "exponent of (e₁, e₂) [1/s]", "off its equation, of the largest error")
    driven = [row for row in rows if row["kind"] == "inputs"]
    cells = [
        (name, f"{row['exponent_per_s']:.3f}", f"{row['deviation']:.1e}")
        for name, row in zip(INPUTS, driven, strict=True)
    ]
    return Table("Example 2.2 under different inputs, α = 2, β = 3", columns, cells)


def _claims(rows: Rows, apart: Mapping[str, float]) -> list[Claim]:
    stable = (_column(rows, "alpha", "map") > 0.0) & (_column(rows, "beta", "map") > 0.0)
    fell = _column(rows, "exponent_per_s", "map") < 0.0
    deviation, inputs, linear = (float(_column(rows, "deviation", kind).max()) for kind in ("map", "inputs", "2.3"))
    starts = len(_column(rows, "deviation", "2.3"))
    escape = float(_column(rows, "escape_time_s", "escape")[0])
    printed, corrected = ([f"{system}, {form}" for system in DRAWN] for form in ("printed", "corrected"))
    ratio = _column(rows, "error_ratio", *printed)
    grew, runs = int((ratio > 1.0).sum()), len(ratio)
    left, followed = (float(_column(rows, name, *corrected).max()) for name in ("error_ratio", "deviation"))
    exponents = _column(rows, "exponent_per_s", *corrected)
    separated = apart["driven"] > 1e3 * apart["still"]
    unseen, hidden = unseen_directions(EXAMPLE_2_1, 1.0), _hidden()
    return [
        Claim(
            "I.example-2-1-observable", "printed", "The input u = 1 distinguishes all initial points.",
            "2.5, Example 2.1", "outputs of points with the same x_1 part under u = 1",
            f"|Δy| / |Δx_2| within 0.4 s at least {apart['driven']:.1e}", separated,
        ),
        Claim(
            "I.example-2-1-no-observer", "printed", "No smooth observer has asymptotically stable error dynamics.",
            "2.5, Example 2.1", "the positive eigenvalue of x_2 is not detectable at the origin",
            f"of the eigenvectors to the eigenvalue 1, y does not see {unseen}", unseen == 1,
        ),
        Claim(
            "I.example-2-2-unobservable", "printed", "x_3 neither is measured nor affects x_1 or x_2.",
            "2.5, Example 2.2", "points that differ in x_3 have the same output",
            f"|Δy| within 0.4 s at most {hidden:.1g}", hidden < 1e-8,
        ),
        Claim(
            "I.example-2-2-observer", "printed", "For proper α and β there is an input-independent observer.",
            "2.5, Example 2.2", "the same error under every input",
            f"under {len(INPUTS)} inputs at most {inputs:.0e} of its largest value off its equation", inputs <= EXACT,
        ),
        Claim(
            "I.linear-error-dynamics", "printed", "In the right coordinates the error obeys a linear equation.",
            "2.4, (2.3)", f"at most {EXACT:.0e} of the largest error off",
            f"at most {linear:.0e} from {starts} starts", linear <= EXACT,
        ),
        Claim(
            "I.equation-2-4", "printed", "(2.4) is a full-state observer.", "2.4, (2.4)", "the error decays",
            f"from {grew} of {runs} starts it has grown after 5 s", grew == 0,
        ),
        Claim(
            "introduction.example-2-1", "target", "Without an input nothing is learnt, with u = 1 all, until the end.",
            "2.5, Example 2.1", "u = 0 indistinguishable, u = 1 separates, and from (0.2, 0.3) it escapes at 1.91 s",
            f"|Δy| / |Δx_2| at most {apart['still']:.0e} and at least {apart['driven']:.1e}; {apart['escape_s']:.4f} s",
            separated and abs(apart["escape_s"] - 1.91) <= 0.005,
        ),
        Claim(
            "introduction.example-2-2", "target", "The observer converges exactly for α > 0 and β > 0.",
            "2.5, Example 2.2",
            f"over the map just there, at most {EXACT:.0e} of the largest error off its equation; x_2 escapes at "
            f"2.65 s under sin t from {ESCAPING}",
            f"{int((fell == stable).sum())} of {len(stable)} as they should; off by at most {deviation:.0e}; "
            f"{escape:.4f} s",
            bool((fell == stable).all()) and deviation <= EXACT and abs(escape - 2.65) <= 0.005,
        ),
        Claim(
            "introduction.equation-2-4", "target", "(2.4) diverges as printed, and converges with its sign put right.",
            "2.4, (2.4)",
            f"printed, the error grows from every start; corrected, it is at most {OF_SERIES:.0e} of the largest error "
            "off exp(At) e(0), of the declared poles",
            f"printed: from {grew} of {runs} starts; corrected: at most {followed:.0e} off, exponent "
            f"{exponents.min():.2f} to {exponents.max():.2f} [1/s], {left:.1e} of the error left",
            grew == runs and followed <= OF_SERIES and left < 1e-2,
        ),
    ]  # fmt: skip


def _figure(rows: Rows, runs: Runs) -> Figure:
    with styled_figure((11.4, 9.6)) as figure:
        parts = figure.subplot_mosaic(
            [["still", "driven", "map"], ["escape", "escape", "map"], ["plane", "linear", "signs"]],
            height_ratios=(1.0, 1.0, 1.25),
        )
        _indistinguishable(parts["still"], parts["driven"])
        _escape(parts["escape"], runs["escape", 0])
        _map(figure, parts["map"], rows)
        _oscillation(parts["plane"], parts["linear"], runs["2.3", 0])
        _signs(parts["signs"], runs)
    return figure


def _indistinguishable(still: Axes, driven: Axes) -> None:
    for k, (x_2, colour) in enumerate(zip(STARTS, SHADES, strict=True)):
        t, y = _output(x_2, 0.0, UNTIL)
        still.plot(t, y, color=colour, lw=5.2 - 1.3 * k)
        t, y = _output(x_2, 1.0, UNTIL)
        driven.plot(t, y, color=colour, lw=1.8)
        at, up = NAMED[k]
        i = min(int(np.searchsorted(t, at)), len(t) - 1)
        annotate(driven, f"$x_2(0) = {x_2:g}$", (t[i], y[i]), (0, up), ha="center", color=colour, size=8.0)
    still.set(xlabel="time [s]", ylabel="y", xlim=(0.0, UNTIL), ylim=(0.0, 0.25), title="(a) Example 2.1, u = 0")
    annotate(still, "four starts, one output", (0.75, 0.12), (0, 10), size=8.0)
    driven.set(xlabel="time [s]", ylabel="y", xlim=(0.0, UNTIL), ylim=(-1.3, 1.3), title="u = 1")


def _output(x_2: float, u: float, end: float) -> tuple[Array, Array]:
    """Return times [s] and outputs of Example 2.1, up to an escape."""
    x, t, y, held = np.array([0.2, x_2]), [0.0], [0.2], np.array([u])
    while t[-1] < end:
        x, reached = EXAMPLE_2_1.reach(x, held, 0.005)
        if reached < 0.005:
            break
        t.append(t[-1] + reached)
        y.append(x[0])
    return np.array(t), np.array(y)


def _escape(axes: Axes, outcome: RunData) -> None:
    t, x_hat, x = estimates(outcome)
    for k in range(3):
        axes.plot(t, x_hat[:, k], color=ESTIMATE, lw=1.8)
        axes.plot(t, x[:, k], "--", color=TRUTH, lw=1.8)
    names = {0: (1.5, 8), 1: (2.42, 0), 2: (1.9, -12)}
    for k, (at, up) in names.items():
        i = int(np.searchsorted(t, at))
        annotate(axes, f"$x_{k + 1}$", (t[i], x[i, k]), (-12 if k == 1 else 0, up))
    end = float(outcome.summary["escape_time_s"])
    axes.axvline(end, color=BOUND, ls=":", lw=1.3)
    annotate(axes, f"$x_2$ escapes at {end:.3f} s", (end, 0.0), (-4, 5), xycoords=("data", "axes fraction"), ha="right",
             color=BOUND)  # fmt: skip
    axes.set(xlabel="time [s]", xlim=(0.0, 1.02 * end), ylim=(-1.8, 5.0))
    axes.set_title("(b) Example 2.2, u = sin t: truth (dashed) and estimate")


def _map(figure: Figure, axes: Axes, rows: Rows) -> None:
    gains = np.unique(_column(rows, "alpha", "map"))
    exponents = _column(rows, "exponent_per_s", "map").reshape(len(gains), len(gains))  # by alpha and beta
    norm = TwoSlopeNorm(0.0, min(float(exponents.min()), -0.1), max(float(exponents.max()), 0.1))
    image = axes.pcolormesh(gains, gains, exponents.T, cmap="RdBu_r", norm=norm, shading="nearest")
    fine = np.linspace(gains[0], gains[-1], 241)
    alpha, beta = np.meshgrid(fine, fine)
    root = 0.5 * (-beta + np.sqrt(np.maximum(beta**2 - 4.0 * alpha, 0.0)))  # the real part of the slower one
    lines = axes.contour(fine, fine, root, [-2.0, -1.5, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0], colors=INK, linewidths=0.7)
    axes.clabel(lines, [level for level in lines.levels if level <= 0.25], fontsize=7.0)  # no room for the others
    corner = float(gains[-1])
    axes.plot([0.0, 0.0, corner], [corner, 0.0, 0.0], color=INK, lw=1.6)
    half = 0.5 * float(gains[1] - gains[0]) if len(gains) > 1 else 0.5
    ends = (float(gains[0]) - half, corner + half)
    axes.set(xlabel="α", ylabel="β", title="(c) Example 2.2: exponent [1/s]", xlim=ends, ylim=ends)
    axes.grid(False)
    figure.colorbar(image, ax=axes, orientation="horizontal", shrink=0.9, pad=0.02)


def _oscillation(plane: Axes, linear: Axes, outcome: RunData) -> None:
    t, x_hat, x = estimates(outcome)
    plane.plot(x_hat[:, 0], x_hat[:, 1], color=ESTIMATE, lw=1.8, label="estimate")
    plane.plot(x[:, 0], x[:, 1], "--", color=TRUTH, lw=1.8, label="truth")
    plane.plot(*x_hat[0], "o", color=ESTIMATE, ms=5)
    plane.plot(*x[0], "o", color=TRUTH, ms=5)
    plane.legend(fontsize=8)
    plane.set(xlabel="$x_1$", ylabel="$x_2$", title="(d) van der Pol, y = sinh $x_1$")
    form = KRENER_ISIDORI.form
    assert form is not None
    T, poles = of_numbers(form.T_1, 2), tuple(outcome.config["estimator"]["fields"]["poles"])
    error = np.array([T(one) - T(other) for one, other in zip(x_hat, x, strict=True)])
    equation = predicted(t, error[0], form.A - form.gain(poles) @ form.C)
    for k, colour in enumerate((SHADES[1], SHADES[2])):
        linear.plot(t, error[:, k], color=colour, lw=3.0, alpha=0.55)
        linear.plot(t, equation[:, k], color=INK, lw=0.9, ls="--")
        i = int(np.argmax(np.abs(error[20:, k]))) + 20
        annotate(linear, f"$z_{k + 1} - \\tilde x_{k + 1}$", (t[i], error[i, k]), (26, -4) if k else (18, 14),
                 color=colour)  # fmt: skip
    linear.set(xlabel="time [s]", xlim=(0.0, 4.0), title="its error, and (2.3) dashed")


def _signs(axes: Axes, runs: Runs) -> None:
    for form, colour in (("printed", SHADES[3]), ("corrected", SHADES[0])):
        name = f"kazantzis-kravaris, {form}"
        for outcome in (run for (kind, _), run in runs.items() if kind == name):
            t, x_hat, x = estimates(outcome)
            error = np.linalg.norm(x_hat - x, axis=1)
            axes.plot(t, np.maximum(error, FLOOR), color=colour, lw=1.5)
    axes.annotate("as printed", (3.0, 1.3), ha="center", color=SHADES[3])
    axes.annotate("with its sign\nput right", (0.1, 2e-4), color=SHADES[0])
    t = np.linspace(0.5, 4.5, 2)
    axes.plot(t, 0.6 * np.exp(-2.0 * t), color=INK, ls="--", lw=1.0)
    annotate(axes, "$e^{-2t}$", (t[1], 0.6 * math.exp(-9.0)), (4, 6))
    axes.set(xlabel="time [s]", ylabel="$|\\hat x - x|$", yscale="log", title="(e) equation (2.4)")


# ---- what is measured


def _of_example_2_2(fields: Mapping[str, Any]) -> Trial:
    return trial(SCENARIO, 0, estimator="example_2_2", fields={**OWN, **fields}, measure=f"{__name__}:example_2_2")


def _signal(constant: float, sine: float) -> dict[str, Any]:
    return {"planner.constant": (constant,), "planner.amplitude": (sine,)}


def _drawn(system: str, estimator: str, fields: Mapping[str, Any], seed: int) -> Trial:
    """Return the trial with a start error drawn uniformly by a seed; equal for all observers of a system."""
    error = DRAWN[system] * np.random.default_rng(seed).uniform(-1.0, 1.0, 2)
    own = {"system": system, "start_error": tuple(error.tolist()), "duration": 5.0, "estimator.poles": POLES}
    return trial(SCENARIO, seed, estimator=estimator, fields={**own, **fields}, measure=f"{__name__}:in_coordinates")


def output_separation(pairs: int) -> dict[str, float]:
    """A job: largest |dy| / |dx_2| under u = 0 and least under u = 1, over pairs with equal x_1 in Example 2.1."""
    rng = np.random.default_rng(0)
    still: list[float] = []
    driven: list[float] = []
    for _ in range(pairs):
        x_1, first, second = rng.uniform(-1.0, 1.0, 3)
        for u, found in ((0.0, still), (1.0, driven)):
            y = [_outputs(EXAMPLE_2_1, np.array([x_1, x_2]), u) for x_2 in (first, second)]
            found.append(float(np.abs(y[0] - y[1]).max() / abs(first - second)))
    _, escape = EXAMPLE_2_1.reach(np.array(EXAMPLE_2_1.start), np.ones(1), 10.0)
    return {"still": max(still), "driven": min(driven), "escape_s": escape}


def _outputs(system: System, x: Array, u: float) -> Array:
    """Return y (20,) over the next 0.4 s under a constant input."""
    held, seen = np.array([u]), []
    for _ in range(20):
        x = system.flow(x, held, 0.02)
        seen.append(system.output(x, held)[0])
    return np.array(seen)


def unseen_directions(system: System, eigenvalue: float) -> int:
    """Return n - rank [s I - F; H] of the linearisation at x = 0, u = 0: the number of unobservable eigenvectors."""
    n = len(system.states)
    x, u = casadi.SX.sym("x", n), casadi.SX.zeros(len(system.inputs))
    F, H = casadi.jacobian(system.f(x, u), x), casadi.jacobian(system.h(x, u), x)
    pencil = casadi.vertcat(eigenvalue * casadi.DM.eye(n) - F, H)
    return n - int(np.linalg.matrix_rank(np.array(casadi.Function("pencil", [x], [pencil])(np.zeros(n)))))


def _hidden() -> float:
    """Return the largest |dy| between initial points of Example 2.2 that differ in x_3, under some constant inputs."""
    start = np.array(EXAMPLE_2_2.start)
    other = start + np.array([0.0, 0.0, 5.0])
    return max(
        float(np.abs(_outputs(EXAMPLE_2_2, start, u) - _outputs(EXAMPLE_2_2, other, u)).max()) for u in (-1.0, 0.0, 1.0)
    )


def example_2_2(outcome: RunData) -> dict[str, Any]:
    """A measure: error e = x^ - x of Example 2.2, compared with its linear equation, and exponent of (e_1, e_2)."""
    fields = outcome.config["estimator"]["fields"]
    t, x_hat, x = estimates(outcome)
    matrix = error_dynamics(fields["alpha"], fields["beta"])
    e = x_hat - x
    return {"deviation": _deviation(t, e, matrix), "exponent_per_s": _exponent(t, e[:, :2], matrix[:2, :2])}


def in_coordinates(outcome: RunData) -> dict[str, Any]:
    """A measure: T(x^) - T(x), compared with d/dt (z - x~) = A (z - x~), with T and A of the observer."""
    fields = outcome.config["estimator"]["fields"]
    system = SYSTEMS[outcome.config["fields"]["system"]]
    immersion = Immersion.for_system(system, tuple(fields["poles"]), fields.get("order", 1))
    T = of_numbers(immersion.T, len(system.states))
    t, x_hat, x = estimates(outcome)
    error = np.array([T(one) - T(other) for one, other in zip(x_hat, x, strict=True)])
    lengths = np.linalg.norm(x_hat - x, axis=1)
    return {
        "deviation": _deviation(t, error, immersion.A),
        "exponent_per_s": _exponent(t, error, immersion.A),
        "error_ratio": float(lengths[-1] / lengths[0]),
    }


def estimates(outcome: RunData) -> tuple[Array, Array, Array]:
    """Return times (k,) [s], estimates (k, n) and true states (k, n), up to an escape."""
    recording = outcome.recording
    found = recording.agents[VEHICLE].estimates
    t = np.array([estimate.t for estimate in found])
    escape = outcome.summary["escape_time_s"]
    lived = t <= (np.inf if escape is None else escape)
    x_hat = np.array([estimate.x for estimate in found])
    return t[lived], x_hat[lived], recording.truths[VEHICLE][np.searchsorted(recording.t, t[lived] - 1e-9)]


def predicted(t: Array, start: Array, matrix: Array) -> Array:
    """Return exp(t A) e(0) (k, n) at equally spaced times (k,) [s]."""
    over_a_period, e = expm((t[1] - t[0]) * matrix), [start]
    for _ in t[1:]:
        e.append(over_a_period @ e[-1])
    return np.array(e)


def _deviation(t: Array, e: Array, matrix: Array) -> float:
    """Return the largest component of e - exp(t A) e(0) (k, n), over the largest one of exp(t A) e(0)."""
    expected = predicted(t, e[0], matrix)
    return float(np.abs(e - expected).max() / np.abs(expected).max())


def _exponent(t: Array, e: Array, matrix: Array) -> float:
    """Return the exponent [1/s] of the slowest decaying, or fastest growing, mode of A in e (k, n).

    In the coordinates of the eigenvectors of A each mode is a separate exponential.
    """
    _, vectors = np.linalg.eig(matrix)
    modes = np.abs(np.linalg.solve(vectors, e[[0, -1]].T.astype(complex)))  # (n, 2) at first and at last
    excited = modes[modes[:, 0] > UNEXCITED * modes[:, 0].max()]
    return float(np.log(excited[:, 1] / excited[:, 0]).max() / t[-1])
