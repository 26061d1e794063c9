"""Theorem D.1 as a figure: size of the neighbourhood of S = 0 in which the observer is a contraction (D.4.3).

Table D.1, from which the theorem is derived, is tested in coordinates with exact derivatives by CasADi.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

from mathnavi.estimators.riemannian.contraction import SasakiMetric, largest_eigenvalue
from mathnavi.estimators.riemannian.gains import CurvatureName, IntrinsicGains
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import TwoPoint, sphere
from mathnavi.models.manifold.tangent_bundle import TangentBundle, bracket
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult

A_AND_B = 3.0
SHOWN: tuple[CurvatureName, ...] = ("minus-one", "none", "plus-one")
COLOURS = {"minus-one": "#0d5fa8", "none": "#8a8f98", "plus-one": "#c2183b"}
NAMES = {"minus-one": "C = -1", "none": "C = 0", "plus-one": "C = 1"}
LAW, WITHIN = 0.905, 0.02  # |eta| theta at the boundary, and how near to it
THIN = 1e-2  # S up to which the law holds
_SMALLEST, _LARGEST = 1e-3, 1.5  # [rad] theta
SPEEDS = (0.0, 1.0, 10.0, 100.0)  # |eta| at which S = 0 is evaluated
_ZERO = 1e-9  # [rad] theta that stands for S = 0
_FASTEST = 1e4  # |eta|
_PIXELS = 40  # along an axis of the map
_METRIC = SasakiMetric()


@configuration
class ContractionConfig:
    """Sample sizes: cases that are computed."""

    distances: Count = 41
    """number of values of theta"""
    directions: Count = 33
    """number of angles between eta and grad S, of which the worst counts"""
    points: Count = 50
    """number of points of TX at which Table D.1 is tested"""


@dataclass(frozen=True)
class AtDistance:
    """A distance theta [rad] between x and xi, and a sign of the curvature term."""

    theta: float
    term: CurvatureName
    directions: int


def fastest_contraction(at: AtDistance) -> float:
    """A job: |eta| up to which the observer contracts at a distance theta for every direction of eta; 0 if never."""

    def worst(speed: float) -> float:
        return worst_eigenvalue(at.theta, speed, at.term, at.directions)

    if worst(1e-6) >= 0.0:
        return 0.0
    high = 1e-3
    while worst(high) < 0.0:
        high *= 2.0
        if high > _FASTEST:
            return math.inf
    return float(brentq(worst, 0.5 * high if high > 1e-3 else 1e-6, high, rtol=1e-6))


def worst_eigenvalue(theta: float, speed: float, term: CurvatureName, directions: int) -> float:
    """Return the largest eigenvalue [1/s] over the angle of eta and grad S, all that matters at constant curvature."""
    space = sphere(3)
    xi = space.origin
    pair = TwoPoint(space, space.exp(xi, space.vector(xi, np.array([theta, 0.0, 0.0]))), xi)
    angles = np.linspace(0.0, math.pi, directions)
    gains = IntrinsicGains(math.sqrt(A_AND_B), 0.5 * math.sqrt(A_AND_B), "constant", term, space.kappa)
    etas = [space.vector(xi, speed * np.array([math.cos(a), math.sin(a), 0.0])) for a in angles]
    return max(largest_eigenvalue(pair, eta, gains, _METRIC) for eta in etas)


def eigenvalue_at_zero(speed: float, term: CurvatureName, directions: int) -> float:
    """A job: largest eigenvalue [1/s] on S = 0, for |eta| = ``speed``."""
    return worst_eigenvalue(_ZERO, speed, term, directions)


def eigenvalues_along(speed: float, pixels: int) -> list[float]:
    """A job: largest eigenvalues (pixels,) [1/s] with C = -1 over the distances of the map, for |eta| = ``speed``."""
    return [worst_eigenvalue(theta, speed, "minus-one", 9) for theta in np.geomspace(1e-2, _LARGEST, pixels)]


class Contraction:
    """Theorem D.1: the contracting neighbourhood of S = 0 is infinitely thin (D.4.3)."""

    Config = ContractionConfig
    quick = ContractionConfig(distances=9, directions=9, points=5)
    title = "Contraction: Theorem D.1 as a law"
    on_terrain = False

    @staticmethod
    def run(config: ContractionConfig, setup: Setup) -> StudyResult:
        thetas = np.geomspace(_SMALLEST, _LARGEST, config.distances)
        jobs = Jobs()
        for term in SHOWN:
            jobs.add(term, fastest_contraction, [AtDistance(theta, term, config.directions) for theta in thetas])
            jobs.add(("at zero", term), eigenvalue_at_zero, SPEEDS, term=term, directions=config.directions)
        jobs.add("fastest", fastest_contraction, [AtDistance(_ZERO, "plus-one", config.directions)])
        jobs.add("brackets", table_d_1, [config.points])
        pixels = min(_PIXELS, config.distances)
        jobs.add("map", eigenvalues_along, np.geomspace(0.1, 100.0, pixels).tolist(), pixels=pixels)
        done = jobs.done(setup)
        boundary = {term: np.array(done[term]) for term in SHOWN}
        at_zero = {term: done["at zero", term] for term in SHOWN}
        (fastest,), (table,) = done["fastest"], done["brackets"]
        thin = 0.5 * thetas**2 <= THIN
        products = (boundary["minus-one"] * thetas)[thin]
        return StudyResult(
            summary=(
                "S^3 without a force, A = B = 3, the generalised Sasaki metric with (a, b, c) = (1, 0.33, -0.5); the "
                "largest eigenvalue of W^-1 L over the angle between eta and grad S.",
            ),
            rows=[
                {"C": NAMES[term], "theta": theta, "fastest_eta": speed}
                for term in SHOWN
                for theta, speed in zip(thetas, boundary[term], strict=True)
            ],
            tables=(Table("Table D.1: largest difference of the two sides", ("bracket", "as printed", "put right"),
                          [(name, f"{p:.1e}", f"{t:.1e}") for name, (p, t) in table.items()]),),
            figure=_figure(thetas, boundary, np.array(done["map"])),
            caption="(a) Below a line the observer contracts: |eta| against the distance between x and xi. Dashed: "
            f"|eta| theta = {LAW:g}. (b) The largest eigenvalue with C = -1; negative is contraction.",
            claims=[*_claims(products, max(at_zero["minus-one"]), table), _sign_claim(at_zero, fastest)],
        )  # fmt: skip


def _claims(products: Array, at_zero: float, table: Mapping[str, tuple[float, float]]) -> list[Claim]:
    error = float(np.abs(products / LAW - 1.0).max())
    wrong = [name for name, (printed, _) in table.items() if printed > 1e-9]
    return [
        Claim(
            "riemannian.contraction", "target", "The contracting neighbourhood of S = 0 has a law.", "Theorem D.1",
            f"|eta| theta = {LAW:g} +- {WITHIN:.0%} at its boundary for S <= {THIN:g}",
            f"{products.min():.4f} to {products.max():.4f}, off by at most {error:.2%}",
            error <= WITHIN,
        ),
        Claim(
            "D.infinitely-thin", "printed", "The neighbourhood is infinitely thin as |eta| grows.", "Theorem D.1",
            "theta at the boundary falls to nought",
            f"theta = {LAW:g} / |eta|; on S = 0 itself the largest eigenvalue is at most {at_zero:.3f} for |eta| "
            "up to 100",
            error <= WITHIN and at_zero < 0.0,
        ),
        Claim(
            "D.brackets", "printed", "The brackets of lifted vector fields are those of the table.", "Table D.1",
            "each to 1e-9",
            f"not {', '.join(wrong)}; put right, all to {max(true for _, true in table.values()):.1e}",
            not wrong,
        ),
    ]  # fmt: skip


def _sign_claim(at_zero: Mapping[CurvatureName, list[float]], fastest: float) -> Claim:
    """Evaluate the claim on S = 0, with the sign of C of (D.6)."""
    found = "; ".join(
        f"{NAMES[term]}: " + ", ".join(f"{value:.4g}" for value in at_zero[term]) for term in ("plus-one", "minus-one")
    )
    return Claim(
        "D.contraction-sign", "printed", "With C = 1 the observer is contractive around S = 0.", "D.4.3",
        "U = 0: the largest eigenvalue of W^-1 L on S = 0 is negative for every eta, C = 1 as (D.6) has it",
        f"for |eta| = {', '.join(f'{speed:g}' for speed in SPEEDS)}: {found}; C = 1 contracts to |eta| = {fastest:.2f} "
        "only. It is C = -1 that the statement is true of: (D.20) has the sign of its C terms reversed",
        max(at_zero["plus-one"]) < 0.0,
    )  # fmt: skip


# ---- Table D.1


def table_d_1(points: int) -> dict[str, tuple[float, float]]:
    """A job: largest difference of the two sides of each bracket over points of TS^3, printed and corrected."""
    n = 3
    bundle = TangentBundle(n, _metric)
    x, v = casadi.SX.sym("x", n), casadi.SX.sym("v", n)
    XH, XV, YH, YV = bundle.horizontal(_X), bundle.vertical(_X), bundle.horizontal(_Y), bundle.vertical(_Y)

    def up(w: casadi.SX) -> casadi.SX:
        return casadi.vertcat(casadi.SX(n, 1), w)

    def along(w: casadi.SX) -> casadi.SX:
        return casadi.vertcat(w, -bundle.christoffel(x, v, w))

    both = casadi.jtimes(_Y(x), x, _X(x)) - casadi.jtimes(_X(x), x, _Y(x))
    bent, slope = bundle.curvature(x, _X(x), _Y(x), v), bundle.covariant(_Y, x, _X(x))
    turned, own = bundle.curvature(x, v, _X(x), v), bundle.covariant(_X, x, v)
    hh, hv, hz = bracket(XH, YH, x, v), bracket(XH, YV, x, v), bracket(XH, bundle.spray, x, v)
    vv, vz = bracket(XV, YV, x, v), bracket(XV, bundle.spray, x, v)
    sides = {
        "[X^H, Y^H]": (hh - along(both), hh - along(both) + up(bent)),
        "[X^H, Y^V]": (hv + up(slope), hv - up(slope)),
        "[X^H, Z]": (hz - up(turned - own), hz - up(turned) + along(own)),
        "[X^V, Y^V]": (vv, vv),
        "[X^V, Z]": (vz - along(_X(x)) + up(own), vz - along(_X(x)) + up(own)),
    }
    rng = np.random.default_rng(0)
    drawn = [(rng.uniform(0.4, 2.7, n), rng.standard_normal(n)) for _ in range(points)]
    found: dict[str, tuple[float, float]] = {}
    for name, pair in sides.items():
        functions = [casadi.Function("side", [x, v], [side]) for side in pair]
        printed, true = (max(float(np.abs(np.array(f(*at))).max()) for at in drawn) for f in functions)
        found[name] = printed, true
    return found


def _metric(x: casadi.SX) -> casadi.SX:
    """Return the metric of S^3 in the angles of D.5."""
    s_1, s_2 = casadi.sin(x[0]), casadi.sin(x[1])
    return casadi.diag(casadi.vertcat(1.0, s_1**2, (s_1 * s_2) ** 2))


def _X(x: casadi.SX) -> casadi.SX:  # noqa: N802  the table's letters
    return casadi.vertcat(x[1] * x[2], casadi.sin(x[0]), x[0] * x[1])


def _Y(x: casadi.SX) -> casadi.SX:  # noqa: N802
    return casadi.vertcat(x[0] ** 2, x[2], casadi.cos(x[1]) * x[0])


# ---- the figure


def _figure(thetas: Array, boundary: Mapping[CurvatureName, Array], eigenvalues: Array) -> Figure:
    with styled_figure((11.5, 4.8)) as page:
        first, second = page.subplots(1, 2)
        first.set_title("(a) where the observer contracts")
        for term, speeds in boundary.items():
            shown = np.isfinite(speeds) & (speeds > 0.0)
            first.plot(thetas[shown], speeds[shown], color=COLOURS[term], lw=2.0)
            if shown.any():
                k = np.flatnonzero(shown)[2 * shown.sum() // 3]
                aside = (6, -16 if term == "plus-one" else 6)
                annotate(first, NAMES[term], (thetas[k], speeds[k]), aside, color=COLOURS[term], weight="bold")
        first.plot(thetas, LAW / thetas, color=INK, lw=1.0, ls=(0, (4, 3)))
        first.set(xscale="log", yscale="log", xlabel=r"$\theta = $ dist$(x, \xi)$", ylabel=r"$|\eta|_g$")
        _draw_map(page, second, eigenvalues)
    return page


def _draw_map(page: Figure, axes: Any, values: Array) -> None:
    axes.set_title("(b) largest eigenvalue, C = -1")
    thetas, speeds = np.geomspace(1e-2, _LARGEST, values.shape[1]), np.geomspace(0.1, 100.0, values.shape[0])
    picture = axes.pcolormesh(
        thetas, speeds, np.clip(values, -3.0, 3.0), cmap="RdBu_r", shading="gouraud", vmin=-3.0, vmax=3.0
    )
    axes.contour(thetas, speeds, values, levels=[0.0], colors=[INK], linewidths=1.5)
    axes.set(xscale="log", yscale="log", xlabel=r"$\theta$", ylabel=r"$|\eta|_g$")
    axes.grid(visible=False)
    bar = page.colorbar(picture, ax=axes, extend="both")
    bar.set_label("[1/s]; negative: any two trajectories approach")
