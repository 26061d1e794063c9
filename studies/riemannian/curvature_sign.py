"""The sign of the curvature term of (D.6): C = -1, that of Theorem D.2, none, and C = 1.

A point moves under a force on S^3 and on H^2, and the observer starts at its position, at rest. The number of converged
runs depends on the time of the comparison and on the force; the claim is evaluated at the end of the runs, and earlier
times are reported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.estimators.riemannian.gains import CurvatureName, IntrinsicGains
from mathnavi.estimators.riemannian.sampled import SampledIntrinsicObserver
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, hyperbolic_space, sphere
from mathnavi.models.manifold.manifold import CutLocusError
from mathnavi.models.manifold.systems import PointSystem, linear
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Proportion, rate
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult

SPEEDS = {"H^2": (0.5, 1.0, 2.0), "S^3": (1.0, 2.0, 4.0)}  # of v0 / omega
JUDGED = {"H^2": 1.0, "S^3": 4.0}  # where the target asks
STRENGTH = {"H^2": 4.0, "S^3": 25.0}  # c of the potential c p_0, in omega^2
TERMS: tuple[CurvatureName, ...] = ("minus-one", "matched", "none", "plus-one")
COMPARED: tuple[CurvatureName, ...] = ("minus-one", "plus-one")
NAMES = {"minus-one": "C = -1", "matched": "C of Theorem D.2", "none": "C = 0", "plus-one": "C = 1"}
COLOURS = {"minus-one": "#0d5fa8", "matched": "#0f9472", "none": "#8a8f98", "plus-one": "#c2183b"}
FACTORS = (1.0, 0.25, 0.5, 2.0, 4.0)  # of the strength, to see what it does
OMEGA, STEP, DURATION = 1.0, 0.01, 20.0  # [1/s], [s] between readings, [s] of a run
TIMES = (6.0, 12.0, DURATION)  # [s] at which runs are evaluated; the last decides the claim
OFTEN = 0.1  # [s] between what is kept of a run
GONE = 0.01  # of the velocity at the start
CONVERGES, FAILS = 0.99, 0.05


@configuration
class CurvatureSignConfig:
    """Sample sizes: runs."""

    seeds: Count = 150
    """number of starts for each space, speed and C"""
    others: Count = 30
    """number of starts for each other strength of the force, with C = -1 and C = 1"""
    strengths: Count = len(FACTORS)
    """largest number of strengths of the force"""


@dataclass(frozen=True)
class Forced:
    """A motion under a force, and the signs C of its observers."""

    space: str
    speed: float  # v0 / omega
    terms: tuple[CurvatureName, ...]
    seed: int
    factor: float = 1.0  # of the potential's strength


def errors_left(run: Forced) -> list[list[float]]:
    """A job: velocity errors by C over that at the start, every ``OFTEN`` s; infinite from when the point is lost."""
    space: ConstantCurvature = sphere(3) if run.space == "S^3" else hyperbolic_space(2)
    system = PointSystem(space, linear(run.factor * STRENGTH[run.space] * OMEGA**2, 0))
    rng, u = np.random.default_rng(run.seed), np.zeros(space.size)
    p = space.draw(rng)
    motion = [system.state(p, run.speed * OMEGA * space.draw_vector(rng, p))]
    for _ in range(round(DURATION / STEP)):
        motion.append(system.reach(motion[-1], u, STEP)[0])
    gains = (IntrinsicGains(OMEGA, 1.0, "constant", term, space.kappa) for term in run.terms)
    return [_followed(SampledIntrinsicObserver(system, each, p), space, motion, run.speed * OMEGA) for each in gains]


def _followed(
    observer: SampledIntrinsicObserver, space: ConstantCurvature, motion: Sequence[Array], v0: float
) -> list[float]:
    left, n, u = [1.0], space.size, np.zeros(space.size)
    for k, x in enumerate(motion[1:], 1):
        try:
            observer.predict(STEP, u, x[:n])
            kept = observer.correct(x[:n], STEP).accepted
            if kept and k % round(OFTEN / STEP) == 0:
                error = x[n:] - space.transport(observer.xi, x[:n], observer.eta)
                left.append(space.norm(x[:n], error) / v0)
        except CutLocusError:
            kept = False
        if not kept:
            return left + [np.inf] * (round(DURATION / OFTEN) + 1 - len(left))
    return left


class CurvatureSign:
    """The required sign of the observer's curvature term (D.6, D.20)."""

    Config = CurvatureSignConfig
    quick = CurvatureSignConfig(seeds=6, others=2)
    title = "The curvature term: its sign"
    on_terrain = False

    @staticmethod
    def run(config: CurvatureSignConfig, setup: Setup) -> StudyResult:
        jobs, forces = Jobs(), list(product(SPEEDS, FACTORS[1 : config.strengths]))
        cases = [(space, speed, term) for space, speeds in SPEEDS.items() for speed, term in product(speeds, TERMS)]
        for space, speeds in SPEEDS.items():
            for speed in speeds:
                jobs.add((space, speed), errors_left, [Forced(space, speed, TERMS, k) for k in range(config.seeds)])
        for space, factor in forces:
            runs = [Forced(space, JUDGED[space], COMPARED, seed, factor) for seed in range(config.others)]
            jobs.add((space, factor, "force"), errors_left, runs)
        done = jobs.done(setup)
        left = {(s, v, c): np.array(done[s, v])[:, TERMS.index(c)] for s, v, c in cases}
        shares = {case: tuple(share(left[case], t) for t in TIMES) for case in cases}
        by_force = {
            (s, f, c): share(np.array(done[s, f, "force"])[:, COMPARED.index(c)], DURATION)
            for (s, f), c in product(forces, COMPARED)
        }
        by_force |= {(s, 1.0, c): shares[s, JUDGED[s], c][-1] for s, c in product(SPEEDS, COMPARED)}
        return StudyResult(
            summary=(
                "A point is forced by U = 4 p_0 on H^2 and 25 p_0 on S^3 (in omega^2), from a position and a direction "
                f"that are drawn; xi = x and eta = 0 at the start, A = 2 omega, B = omega^2, readings every {STEP:g} / "
                "omega. Converged: the velocity error is under 1 % of the velocity at the start, at the time that is "
                f"said; judged at the end, {DURATION:g} / omega.",
                "With C = 1 some runs converge late, and how many depends on the force as on the time: the share is no "
                "property of the sign alone. Nor is that with C = -1 on S^3: under a weak or a strong force not every "
                "run converges.",
            ),
            rows=[
                {"space": s, "speed_over_omega": v, "C": NAMES[c], "strength": STRENGTH[s], "t_omega": t,
                 "converged": r.events, "runs": r.trials}
                for (s, v, c), values in shares.items() for t, r in zip(TIMES, values, strict=True)
            ] + [
                {"space": s, "speed_over_omega": JUDGED[s], "C": NAMES[c], "strength": factor * STRENGTH[s],
                 "t_omega": DURATION, "converged": r.events, "runs": r.trials}
                for (s, factor, c), r in by_force.items() if factor != 1.0
            ],
            tables=(_time_table(shares), _force_table(by_force)),
            figure=_figure(left, shares, by_force),
            caption="(a), (b) Velocity error over that at the start: medians, and between the quartiles, at the speed "
            f"that the target asks for; dashed: 1 %. (c) Share of runs that have converged by {DURATION:g} / omega, by "
            "speed, with 95 % limits of Clopper and Pearson. (d) That share by the strength c of the force, at the "
            "speed that the target asks for.",
            claims=[_claim(shares, by_force)],
        )  # fmt: skip


def share(left: Array, t: float) -> Proportion:
    """Return the share of runs (n, m) that have converged at t [s]."""
    return rate(int((left[:, round(t / OFTEN)] < GONE).sum()), len(left))


Case = tuple[str, float, CurvatureName]  # space, speed and C
Force = tuple[str, float, CurvatureName]  # space, factor of the strength, and C


def _claim(shares: Mapping[Case, Sequence[Proportion]], by_force: Mapping[Force, Proportion]) -> Claim:
    parts = []
    for space, speed in JUDGED.items():
        minus, plus = shares[space, speed, "minus-one"], shares[space, speed, "plus-one"]
        early = ", ".join(
            f"{t:g} / omega: {m.value:.1%} and {p.value:.1%}" for t, m, p in zip(TIMES, minus, plus, strict=True)
        )
        forced = [r.value for (s, _, c), r in by_force.items() if s == space and c == "plus-one"]
        least = min(r.value for (s, _, c), r in by_force.items() if s == space and c == "minus-one")
        parts.append(
            f"{space} at {speed:g} omega, C = -1 and +1 of {minus[-1].trials} by {early}; by the force, C = +1 "
            f"{min(forced):.0%} to {max(forced):.0%}, C = -1 at least {least:.0%}"
        )
    last = {(space, term): shares[space, JUDGED[space], term][-1].value for space, term in product(SPEEDS, COMPARED)}
    return Claim(
        "riemannian.sign", "target", "The curvature term has to be taken with C = -1.", "(D.6), D.4.3, D.5",
        f"forced, v0 = omega on H^2 and 4 omega on S^3: C = -1 converges in at least {CONVERGES:.0%}, C = +1 in at "
        f"most {FAILS:.0%} (no time is stated: judged by {DURATION:g} / omega, the end of the runs)",
        "; ".join(parts),
        all(last[s, "minus-one"] >= CONVERGES and last[s, "plus-one"] <= FAILS for s in SPEEDS),
    )  # fmt: skip


def _time_table(shares: Mapping[Case, Sequence[Proportion]]) -> Table:
    rows = [
        (space, f"{v:g}", f"{t:g}", *(shares[space, v, term][k].text() for term in TERMS))
        for space, speeds in SPEEDS.items()
        for v in speeds
        for k, t in enumerate(TIMES)
    ]
    head = ("space", "v0 / omega", "by [1 / omega]", *(NAMES[term] for term in TERMS))
    return Table("Runs that have converged, by time", head, rows)


def _force_table(by_force: Mapping[Force, Proportion]) -> Table:
    rows = [
        (s, f"{JUDGED[s]:g}", f"{f * STRENGTH[s]:g}", *(by_force[s, f, c].text() for c in COMPARED))
        for s, f in sorted({(s, f) for s, f, _ in by_force})
    ]
    head = ("space", "v0 / omega", "c [omega^2]", *(NAMES[term] for term in COMPARED))
    return Table(f"Runs that have converged by {DURATION:g} / omega, by the strength of the force", head, rows)


def _figure(
    done: Mapping[Case, Array], shares: Mapping[Case, Sequence[Proportion]], by_force: Mapping[Force, Proportion]
) -> Figure:
    with styled_figure((12.0, 8.6)) as page:
        axes = page.subplots(2, 2).ravel()
        for k, space in enumerate(SPEEDS):
            _draw_errors(axes[k], {term: done[space, JUDGED[space], term] for term in TERMS})
            axes[k].set_title(f"({'ab'[k]}) ${space}$, $v_0 = {JUDGED[space]:g}\\,\\omega$")
        _draw_shares(axes[2], {case: values[-1] for case, values in shares.items()})
        _draw_forces(axes[3], by_force)
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
    axes.axhline(GONE, color=INK, lw=0.9, ls=(0, (4, 3)))
    axes.set(yscale="log", ylim=(1e-6, 30.0), xlim=(0.0, DURATION), xlabel=r"time [1 / $\omega$]",
             ylabel=r"$|v - \hat v| / v_0$")  # fmt: skip
    axes.legend(loc="lower left", fontsize=8.0)


def _draw_shares(axes: Axes, shares: Mapping[Case, Proportion]) -> None:
    axes.set_title(f"(c) converged by {DURATION:g} / $\\omega$")
    places = [(space, speed) for space, speeds in SPEEDS.items() for speed in speeds]
    for k, term in enumerate(TERMS):
        own: Sequence[Proportion] = [shares[space, speed, term] for space, speed in places]
        x = np.arange(len(places)) + 0.2 * (k - 1.5)
        axes.bar(x, [r.value for r in own], 0.18, color=COLOURS[term], alpha=0.9)
        axes.vlines(x, [r.low for r in own], [r.high for r in own], color="#1b2733", lw=1.0)
    axes.set_xticks(range(len(places)), [f"${space}$\n{speed:g} ω" for space, speed in places])
    axes.set_ylim(0.0, 1.03)
    axes.grid(axis="x", visible=False)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")


def _draw_forces(axes: Axes, by_force: Mapping[Force, Proportion]) -> None:
    axes.set_title(f"(d) converged by {DURATION:g} / $\\omega$, by the force")
    for space, term in product(SPEEDS, COMPARED):
        own = sorted((f * STRENGTH[space], r) for (s, f, c), r in by_force.items() if (s, c) == (space, term))
        x, ratios = [c for c, _ in own], [r for _, r in own]
        style, marker = ("-", "o") if space == "S^3" else ((0, (4, 2)), "s")
        axes.plot(x, [r.value for r in ratios], color=COLOURS[term], ls=style, marker=marker, lw=1.8, ms=5.0,
                  label=f"${space}$, {NAMES[term]}")  # fmt: skip
        axes.vlines(x, [r.low for r in ratios], [r.high for r in ratios], color=COLOURS[term], lw=1.0, alpha=0.6)
    axes.set(xscale="log", xlabel=r"c [$\omega^2$]", ylim=(-0.02, 1.03))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    axes.legend(loc="center left", fontsize=8.0)
