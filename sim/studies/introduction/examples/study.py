"""The examples that the Introduction explains observers by (thesis 2.4, 2.5), run and held against what it says.

Example 2.1 is observable and has no smooth observer; Example 2.2 has an observer and is not observable. (2.3) promises
linear error dynamics in the right coordinates, (2.4) the same in the original ones, if its sign is put right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi
import numpy as np

from mathnavi.models.textbook.example_2_1 import EXAMPLE_2_1
from mathnavi.models.textbook.example_2_2 import EXAMPLE_2_2, error_dynamics
from mathnavi.models.textbook.system import System
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.introduction.examples import measures
from mathnavi.sim.studies.introduction.examples.figure import IntroductionRuns, introduction_figure
from mathnavi.sim.sweep.trial import Trial, trial

SCENARIO = "textbook-observer"
OWN = {"duration": 5.0, "start_error": (1.0, 0.4, 1.0)}  # of the runs of Example 2.2
POLES = (-2.0, -3.0)
ESCAPING = (0.1, -0.5, 0.0)  # of Example 2.2 under u = sin t
BOUNDED = (-5.0, -2.0, 0.0)  # from where it does not escape under any of the inputs
LEAST, LARGEST = -0.75, 6.25  # alpha and beta of the map
INPUTS = {"u = 0": (0.0, 0.0), "u = -0.2": (-0.2, 0.0), "u = sin t": (0.0, 1.0), "u = 2 sin t": (0.0, 2.0)}
FORMS = ("printed", "corrected", "z")
DRAWN = {"krener-isidori": 1.5, "kazantzis-kravaris": 0.3}  # largest error of each state at the start
EXACT, OF_SERIES = 1e-5, 5e-3  # of the largest error, from which an error may differ from its equation


@configuration
class IntroductionExamplesConfig:
    """Sample sizes: runs."""

    grid: Count = 15
    """values of alpha, and of beta"""
    starts: Count = 25
    """drawn errors at the start for each observer of 2.4"""
    pairs: Count = 200
    """pairs of initial points of Example 2.1"""


class IntroductionExamples:
    """Examples 2.1 and 2.2, linear error dynamics (2.3), and equation (2.4) printed and corrected."""

    Config = IntroductionExamplesConfig
    quick = IntroductionExamplesConfig(grid=5, starts=3, pairs=40)
    title = "The Introduction's examples of observers"
    on_terrain = False

    @staticmethod
    def run(config: IntroductionExamplesConfig, setup: Setup) -> StudyResult:
        gains = np.linspace(LEAST, LARGEST, config.grid)
        asked: dict[str, list[Trial]] = {
            "map": [_example_2_2({"estimator.alpha": a, "estimator.beta": b}) for a in gains for b in gains],
            "inputs": [_example_2_2({"start": BOUNDED, **_signal(*values)}) for values in INPUTS.values()],
            "escape": [_example_2_2({"start": ESCAPING})],
            "2.3": [_drawn("krener-isidori", "output_injection", {}, k) for k in range(config.starts)],
        }
        for system in DRAWN:
            for form in FORMS:
                fields = {"estimator.form": form}
                asked[f"{system}, {form}"] = [
                    _drawn(system, "kazantzis_kravaris", fields, k) for k in range(config.starts)
                ]
        records = setup.fly_groups(asked)
        (apart,) = setup.compute(output_separation, [config.pairs])
        examples = {("escape", 0): asked["escape"][0], ("oscillation", 0): asked["2.3"][0]}
        for form in ("printed", "corrected"):
            examples |= {(form, k): one for k, one in enumerate(asked[f"kazantzis-kravaris, {form}"][:3])}
        runs = setup.flown(examples)
        shown = IntroductionRuns(
            gains=gains,
            exponents=figures(records["map"], "exponent_per_s").reshape(config.grid, config.grid),
            escape=runs["escape", 0],
            oscillation=runs["oscillation", 0],
            forms={form: [run for (name, _), run in runs.items() if name == form] for form in ("printed", "corrected")},
        )
        return StudyResult(
            summary=(
                "Every figure is of a run in the loop: the observers see readings a hundred times a second and no "
                "more, and follow their equations over the polynomial through the last four of them.",
            ),
            rows=_rows(records, gains),
            tables=(_coordinates(records), _inputs(records)),
            figure=introduction_figure(shown),
            caption="(a) Example 2.1 from four initial points that read the same at first. (b) Example 2.2 under sin "
            "t, until it escapes. (c) Exponent of its error over (alpha, beta): measured, and as lines the "
            "real part of the slower root. (d) Van der Pol's oscillator and its observer, and the error in the "
            "coordinates of (2.3). (e) Equation (2.4) from three starts, as printed and with its sign put right.",
            claims=_claims(records, gains, apart),
        )


def _example_2_2(fields: Mapping[str, Any]) -> Trial:
    return trial(SCENARIO, 0, estimator="example_2_2", fields={**OWN, **fields}, measure=measures.EXAMPLE_2_2)


def _signal(constant: float, sine: float) -> dict[str, Any]:
    return {"planner.constant": (constant,), "planner.amplitude": (sine,)}


def _drawn(system: str, estimator: str, fields: Mapping[str, Any], seed: int) -> Trial:
    """Trial from a start error drawn with a seed, uniformly on each state; the same for every observer of a system."""
    error = DRAWN[system] * np.random.default_rng(seed).uniform(-1.0, 1.0, 2)
    own = {"system": system, "start_error": tuple(error.tolist()), "duration": 5.0, "estimator.poles": POLES}
    return trial(SCENARIO, seed, estimator=estimator, fields={**own, **fields}, measure=measures.IN_COORDINATES)


def output_separation(pairs: int) -> dict[str, float]:
    """Largest |dy| under u = 0 and least under u = 1 over pairs of initial points of Example 2.1 with one x_1."""
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
    """y (20,) over the next 0.4 s with one input held."""
    held, seen = np.array([u]), []
    for _ in range(20):
        x = system.flow(x, held, 0.02)
        seen.append(system.output(x, held)[0])
    return np.array(seen)


def unseen_directions(system: System, eigenvalue: float) -> int:
    """n - rank [s I - F; H] of the linearisation at the origin without an input: eigenvectors that y does not see."""
    n = len(system.states)
    x, u = casadi.SX.sym("x", n), casadi.SX.zeros(len(system.inputs))
    F, H = casadi.jacobian(system.f(x, u), x), casadi.jacobian(system.h(x, u), x)
    pencil = casadi.vertcat(eigenvalue * casadi.DM.eye(n) - F, H)
    return n - int(np.linalg.matrix_rank(np.array(casadi.Function("pencil", [x], [pencil])(np.zeros(n)))))


def expected_exponent(alpha: float, beta: float) -> float:
    """[1/s] the largest real part of the roots of s^2 + beta s + alpha."""
    return float(np.linalg.eigvals(error_dynamics(alpha, beta)[:2, :2]).real.max())


def _rows(records: Mapping[str, Sequence[Record]], gains: Array) -> list[dict[str, Any]]:
    named = ("deviation", "exponent_per_s", "error_ratio", "error_start", "error_end", "escaped", "escape_time_s")
    rows = []
    for name, group in records.items():
        for k, record in enumerate(group):
            pair = divmod(k, len(gains)) if name == "map" else None
            rows.append(
                {
                    "kind": name,
                    "run": k,
                    "alpha": gains[pair[0]] if pair else None,
                    "beta": gains[pair[1]] if pair else None,
                    **{key: record.summary.get(key) for key in named},
                }
            )
    return rows


def _coordinates(records: Mapping[str, Sequence[Record]]) -> Table:
    columns = ("observer", "starts", "error at the end over that at the start, median", "largest",
               "exponent, median [1/s]", "off its equation, largest")  # fmt: skip
    rows = []
    for name, group in records.items():
        if name in ("map", "inputs", "escape"):
            continue
        ratio, exponent = figures(group, "error_ratio"), figures(group, "exponent_per_s")
        rows.append(
            ("krener-isidori, (2.3)" if name == "2.3" else name, str(len(group)), f"{np.median(ratio):.2g}",
             f"{ratio.max():.2g}", f"{np.median(exponent):.2f}", f"{figures(group, 'deviation').max():.1e}")
        )  # fmt: skip
    return Table(f"Observers in the coordinates of 2.4 and in the original ones, poles {POLES[0]:g}, {POLES[1]:g}",
                 columns, rows)  # fmt: skip


def _inputs(records: Mapping[str, Sequence[Record]]) -> Table:
    columns = ("input", "exponent of (e₁, e₂) [1/s]", "off its equation, of the largest error")
    rows = [
        (name, f"{record.summary['exponent_per_s']:.3f}", f"{record.summary['deviation']:.1e}")
        for name, record in zip(INPUTS, records["inputs"], strict=True)
    ]
    return Table("Example 2.2 under different inputs, α = 2, β = 3", columns, rows)


def _claims(records: Mapping[str, Sequence[Record]], gains: Array, apart: Mapping[str, float]) -> list[Claim]:
    grid = [(alpha, beta) for alpha in gains for beta in gains]
    stable = np.array([alpha > 0.0 and beta > 0.0 for alpha, beta in grid])
    fell = figures(records["map"], "exponent_per_s") < 0.0
    deviation = float(figures(records["map"], "deviation").max())
    inputs = float(figures(records["inputs"], "deviation").max())
    escape = float(records["escape"][0].summary["escape_time_s"])
    linear = float(figures(records["2.3"], "deviation").max())
    printed, corrected = (
        {system: records[f"{system}, {form}"] for system in DRAWN} for form in ("printed", "corrected")
    )
    grew = sum(int((figures(group, "error_ratio") > 1.0).sum()) for group in printed.values())
    left = max(float(figures(group, "error_ratio").max()) for group in corrected.values())
    followed = max(float(figures(group, "deviation").max()) for group in corrected.values())
    exponents = np.concatenate([figures(group, "exponent_per_s") for group in corrected.values()])
    runs = sum(map(len, printed.values()))
    separated = apart["driven"] > 1e3 * apart["still"]
    unseen = unseen_directions(EXAMPLE_2_1, 1.0)
    hidden = _hidden()
    return [
        Claim(
            "I.example-2-1-observable", "printed", "The input u = 1 distinguishes all initial points.",
            "2.5, Example 2.1", "outputs of points with the same x_1 part under u = 1",
            f"|Δy| / |Δx_2| within .4 s at least {apart['driven']:.1e}", separated,
        ),
        Claim(
            "I.example-2-1-no-observer", "printed", "No smooth observer has asymptotically stable error dynamics.",
            "2.5, Example 2.1", "the positive eigenvalue of x_2 is not detectable at the origin",
            f"of the eigenvectors to the eigenvalue 1, y does not see {unseen}", unseen == 1,
        ),
        Claim(
            "I.example-2-2-unobservable", "printed", "x_3 neither is measured nor affects x_1 or x_2.",
            "2.5, Example 2.2", "points that differ in x_3 have the same output",
            f"|Δy| within .4 s at most {hidden:.1g}", hidden < 1e-8,
        ),
        Claim(
            "I.example-2-2-observer", "printed", "For proper α and β there is an input-independent observer.",
            "2.5, Example 2.2", "the same error under every input",
            f"under {len(INPUTS)} inputs at most {inputs:.0e} of its largest value off its equation", inputs <= EXACT,
        ),
        Claim(
            "I.linear-error-dynamics", "printed", "In the right coordinates the error obeys a linear equation.",
            "2.4, (2.3)", f"at most {EXACT:.0e} of the largest error off",
            f"at most {linear:.0e} from {len(records['2.3'])} starts", linear <= EXACT,
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
            f"{int((fell == stable).sum())} of {len(grid)} as they should; off by at most {deviation:.0e}; "
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


def _hidden() -> float:
    """Largest |dy| between initial points of Example 2.2 that differ in x_3, under inputs held at some values."""
    start = np.array(EXAMPLE_2_2.start)
    other = start + np.array([0.0, 0.0, 5.0])
    return max(
        float(np.abs(_outputs(EXAMPLE_2_2, start, u) - _outputs(EXAMPLE_2_2, other, u)).max()) for u in (-1.0, 0.0, 1.0)
    )
