"""What sign the curvature term of (D.6) needs: C = -1, that of Theorem D.2, none, and C = 1.

A point is forced over S^3 and over H^2, and the observer starts where it is, at rest. (D.20) is printed with the sign
of its C terms reversed, so what is called "C = 1" there is C = -1 in (D.6).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimators.riemannian.gains import CurvatureName, Gains
from estimators.riemannian.sampled import SampledObserver
from models.manifold.constant_curvature import ConstantCurvature, hyperbolic_space, sphere
from models.manifold.manifold import CutLocusError
from models.manifold.systems import PointSystem, linear
from renders.claims import Claim
from renders.figures import STYLE
from renders.study_report import Table
from sim.signals import Array
from sim.statistics import Rate, rate
from sim.studies.jobs import Jobs
from sim.studies.study import Findings, Setup, check_counts

SPEEDS = {"H^2": (0.5, 1.0, 2.0), "S^3": (1.0, 2.0, 4.0)}  # of v0 / omega
JUDGED = {"H^2": 1.0, "S^3": 4.0}  # where the target asks
STRENGTH = {"H^2": 4.0, "S^3": 25.0}  # c of the potential c p_0, in omega^2
TERMS: tuple[CurvatureName, ...] = ("minus-one", "matched", "none", "plus-one")
NAMES = {"minus-one": "C = -1", "matched": "C of Theorem D.2", "none": "C = 0", "plus-one": "C = 1"}
COLOURS = {"minus-one": "#0d5fa8", "matched": "#0f9472", "none": "#8a8f98", "plus-one": "#c2183b"}
OMEGA, STEP, DURATION = 1.0, 0.01, 20.0  # [1/s], [s] between readings, [s] of a run
JUDGED_AT = 12.0  # [s]
OFTEN = 0.1  # [s] between what is kept of a run
GONE = 0.01  # of the velocity at the start
CONVERGES, FAILS = 0.99, 0.05


@dataclass(frozen=True)
class CurvatureSignConfig:
    """How much is run."""

    seeds: int = 150
    """starts for each space, speed and C"""

    def __post_init__(self) -> None:
        check_counts(self)


@dataclass(frozen=True)
class Forced:
    """One run: all that a worker needs."""

    space: str
    speed: float  # v0 / omega
    term: CurvatureName
    seed: int


def error_left(run: Forced) -> list[float]:
    """|Delta v| of the velocity at the start, ten times a second; infinite from when the observer has lost the point.

    The same seed is the same motion for every C.
    """
    space: ConstantCurvature = sphere(3) if run.space == "S^3" else hyperbolic_space(2)
    system = PointSystem(space, linear(STRENGTH[run.space] * OMEGA**2, 0))
    rng, n = np.random.default_rng(run.seed), space.size
    p = space.draw(rng)
    x, u = system.state(p, run.speed * OMEGA * space.draw_vector(rng, p)), np.zeros(n)
    gains = Gains(OMEGA, 1.0, "constant", run.term, space.kappa)
    observer, left = SampledObserver(system, gains, p), [1.0]
    for k in range(1, round(DURATION / STEP) + 1):
        x, _ = system.reach(x, u, STEP)
        try:
            observer.predict(STEP, u, x[:n])
            kept = observer.correct(x[:n], STEP).accepted
            off = x[n:] - space.transport(observer.xi, x[:n], observer.eta)
        except CutLocusError:
            kept = False
        if not kept:
            return left + [np.inf] * (round(DURATION / OFTEN) + 1 - len(left))
        if k % round(OFTEN / STEP) == 0:
            left.append(space.norm(x[:n], off) / (run.speed * OMEGA))
    return left


class CurvatureSign:
    """What sign the curvature term of the observer needs (D.6, D.20)."""

    Config = CurvatureSignConfig
    quick = CurvatureSignConfig(seeds=6)
    title = "The curvature term: its sign"
    on_terrain = False

    @staticmethod
    def run(config: CurvatureSignConfig, setup: Setup) -> Findings:
        jobs = Jobs()
        cases = [(space, speed, term) for space, speeds in SPEEDS.items() for speed, term in product(speeds, TERMS)]
        for case in cases:
            jobs.add(case, error_left, [Forced(*case, seed) for seed in range(config.seeds)])
        done = {case: np.array(some) for case, some in jobs.done(setup).items()}
        shares = {case: share(done[case], JUDGED_AT) for case in cases}
        late = {space: share(done[space, speed, "plus-one"], DURATION) for space, speed in JUDGED.items()}
        return Findings(
            summary=(
                "A point is forced by U = 4 p_0 on H^2 and 25 p_0 on S^3 (in omega^2), from a position and a direction "
                f"that are drawn; xi = x and eta = 0 at the start, A = 2 omega, B = omega^2, readings every {STEP:g} / "
                f"omega. Converged: the velocity error is under 1 % of the velocity at the start {JUDGED_AT:g} / "
                "omega after it.",
            ),
            rows=[
                {"space": s, "speed_over_omega": v, "C": NAMES[c], "converged": r.events, "runs": r.trials}
                for (s, v, c), r in shares.items()
            ],
            tables=(_table(shares),),
            figure=_figure(done, shares),
            caption="(a), (b) Velocity error over that at the start: medians, and between the quartiles, at the speed "
            "that the target asks for. (c) Share of runs that have converged, by speed, with 95 % limits of Clopper "
            "and Pearson.",
            claims=_claims(shares, late),
        )


def share(left: Array, t: float) -> Rate:
    """Of runs (n, m), those that have converged at t [s]."""
    return rate(int((left[:, round(t / OFTEN)] < GONE).sum()), len(left))


Case = tuple[str, float, CurvatureName]


def _claims(shares: Mapping[Case, Rate], late: Mapping[str, Rate]) -> list[Claim]:
    minus, plus = (
        {space: shares[space, JUDGED[space], term] for space in SPEEDS} for term in ("minus-one", "plus-one")
    )
    told = "; ".join(
        f"{space} at {JUDGED[space]:g} omega: C = -1 {minus[space].value:.1%}, C = +1 {plus[space].value:.1%} "
        f"of {minus[space].trials} ({late[space].value:.1%} by {DURATION:g} / omega)"
        for space in SPEEDS
    )
    return [
        Claim(
            "riemannian.sign", "target", "The curvature term has to be taken with C = -1.", "(D.6), D.4.3, D.5",
            f"forced, v0 = omega on H^2 and 4 omega on S^3: C = -1 converges in at least {CONVERGES:.0%}, C = +1 in at "
            f"most {FAILS:.0%}",
            told,
            all(minus[s].value >= CONVERGES and plus[s].value <= FAILS for s in SPEEDS),
        ),
        Claim(
            "D.contraction-sign", "printed", "With C = 1 the observer is contractive around S = 0.", "D.4.3",
            "as (D.6) has C, C = 1 converges where C = -1 does",
            told,
            all(plus[s].value >= minus[s].value for s in SPEEDS),
        ),
    ]  # fmt: skip


def _table(shares: Mapping[Case, Rate]) -> Table:
    rows: list[tuple[Any, ...]] = []
    for space, speeds in SPEEDS.items():
        rows += [(space, f"{v:g}", *(shares[space, v, term].text() for term in TERMS)) for v in speeds]
    return Table("Runs that converge", ("space", "v0 / omega", *(NAMES[term] for term in TERMS)), rows)


def _figure(done: Mapping[Case, Array], shares: Mapping[Case, Rate]) -> Figure:
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(13.0, 4.4), layout="constrained")
        axes = page.subplots(1, 3)
        for k, space in enumerate(SPEEDS):
            _draw_errors(axes[k], {term: done[space, JUDGED[space], term] for term in TERMS})
            axes[k].set_title(f"({'ab'[k]}) ${space}$, $v_0 = {JUDGED[space]:g}\\,\\omega$")
        _draw_shares(axes[2], shares)
    return page


def _draw_errors(axes: Axes, errors: Mapping[CurvatureName, Array]) -> None:
    for term, left in errors.items():
        t = OFTEN * np.arange(left.shape[1])
        finite = np.minimum(left, 1e3)
        low, middle, high = np.quantile(finite, [0.25, 0.5, 0.75], axis=0)
        axes.fill_between(t, low, high, color=COLOURS[term], alpha=0.15, lw=0.0)
        axes.plot(
            t, middle, color=COLOURS[term], lw=1.8, ls=(0, (4, 2)) if term == "matched" else "-", label=NAMES[term]
        )
    axes.set_yscale("log")
    axes.set_ylim(1e-6, 30.0)
    axes.set_xlim(0.0, DURATION)
    axes.set_xlabel(r"time [1 / $\omega$]")
    axes.set_ylabel(r"$|v - \hat v| / v_0$")
    axes.legend(loc="lower left", fontsize=8.0)


def _draw_shares(axes: Axes, shares: Mapping[Case, Rate]) -> None:
    axes.set_title("(c) runs that converge")
    places = [(space, speed) for space, speeds in SPEEDS.items() for speed in speeds]
    for k, term in enumerate(TERMS):
        own: Sequence[Rate] = [shares[space, speed, term] for space, speed in places]
        x = np.arange(len(places)) + 0.2 * (k - 1.5)
        axes.bar(x, [r.value for r in own], 0.18, color=COLOURS[term], alpha=0.9)
        axes.vlines(x, [r.low for r in own], [r.high for r in own], color="#1b2733", lw=1.0)
    axes.set_xticks(range(len(places)), [f"${space}$\n{speed:g} ω" for space, speed in places])
    axes.set_ylim(0.0, 1.03)
    axes.grid(axis="x", visible=False)
