"""Claims of the study ``range-convergence``, evaluated from its results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.consistency import Consistency, RootMeanSquare, consistency, root_mean_square
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Proportion, rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.studies.ranging.range_convergence.costs import ALL_ALIVE, BANK_LOOP, PARTICLE_LOOP
from mathnavi.sim.studies.ranging.range_convergence.runs import BANK, EKF, FLOOR, PARTICLES, EstimatorResult, converged

OBSERVED: Mapping[str, float] = {"2s": 0.95, "3": 0.95, "4": 0.95, "2t": 0.85}
"""shares of starts from which the observer is to find the state, by sensors"""
BEYOND_EKF: Mapping[str, float] = {"2s": 1.25, "2t": 1.25, "4": 1.15}
"""times the share of the EKF that the bank's is to be"""
FOUND, IN_BEAN = 0.98, 0.95  # shares of starts from which the bank is to find the pose
OVER_FLOOR, OVER_PARTICLES, CHEAPER = 1.4, 1.0, 20.0
DRIVEN: Mapping[str, float] = {"2s": 0.03, "4": 0.02}
"""[m] that the RMS position error on wheels may be, by sensors"""
REAL_TIME = 10.0
DEGREES = 3  # of a pose
ELLIPSE, BEAN_WALL = "ellipse", "bean"

FoundKey = tuple[str, str, str]
"""wall, sensors, estimator"""


@dataclass(frozen=True)
class ConvergenceResults:
    """Results from which the claims are evaluated."""

    observed: Mapping[str, Proportion]  # by sensors: starts from which the observer finds the state, without noise
    found: Mapping[FoundKey, Sequence[EstimatorResult]]
    costs: Mapping[str, Mapping[str, Array]]  # by sensors and name: (R,) [us] an update
    drives: Mapping[tuple[str, float], Sequence[Record]]  # by sensors and friction
    run_cpu: Array  # (R,) CPU time of a run on wheels over its duration

    def share(self, wall: str, sensors: str, estimator: str) -> Proportion:
        """Share of the runs in which an estimator converged."""
        runs = self.found[wall, sensors, estimator]
        return rate(len(converged(runs)), len(runs))

    def rms(self, wall: str, sensors: str, estimator: str) -> RootMeanSquare | None:
        """[m] of the runs in which it converged; None without any."""
        values = [found.position for found in converged(self.found[wall, sensors, estimator])]
        return root_mean_square(values, np.random.default_rng(0)) if values else None

    def nees(self, sensors: str) -> Consistency | None:
        """Average NEES of the bank at the end of the runs in which it converged; None without any."""
        squares = [found.nees[-1] for found in converged(self.found[ELLIPSE, sensors, BANK])]
        return consistency(squares, DEGREES) if squares else None

    def nis(self, sensors: str, estimator: str) -> float:
        """A ray, of the runs in which it converged: 1 of a consistent filter; NaN where it has none."""
        ratios = [found.nis / found.rays for found in converged(self.found[ELLIPSE, sensors, estimator])]
        return float(np.mean(ratios)) if ratios else math.nan

    def driven(self, sensors: str, friction: float) -> float:
        """[m] RMS over the runs on wheels."""
        return float(np.sqrt(np.mean(np.square(figures(self.drives[sensors, friction], "position_rms_m")))))

    def cheaper(self, sensors: str, name: str) -> float:
        """Ratio of the costs of an update: the particle filter's over that of a loop of the bank's kernels."""
        return float(np.median(self.costs[sensors][PARTICLE_LOOP] / self.costs[sensors][name]))


def claims(e: ConvergenceResults) -> list[Claim]:
    """Evaluate every claim of the study."""
    return [_global(e), _bank(e), _nonconvex(e), _diffdrive(e), _consistency(e)]


def _global(e: ConvergenceResults) -> Claim:
    return Claim(
        "range.global", "target", "Without noise and turning, the observer finds the pose from anywhere.", "C.3, C.4",
        "manifold feed-forward, figure of eight: " + _each({name: f">= {least:g}" for name, least in OBSERVED.items()}),
        _each({name: e.observed[name].text() for name in OBSERVED}),
        all(e.observed[name].value >= least for name, least in OBSERVED.items()),
    )  # fmt: skip


def _bank(e: ConvergenceResults) -> Claim:
    shares, holds = {}, []
    ratios: dict[str, list[float]] = {FLOOR: [], PARTICLES: []}
    for name, least in BEYOND_EKF.items():
        bank, ekf = e.share(ELLIPSE, name, BANK), e.share(ELLIPSE, name, EKF)
        beyond = bank.value / ekf.value if ekf.events else math.inf
        shares[name] = f"{bank.text()}, {beyond:.2f} times the EKF's"
        holds += [bank.value >= FOUND, beyond >= least, e.cheaper(name, ALL_ALIVE) >= CHEAPER]
        for other, most in ((FLOOR, OVER_FLOOR), (PARTICLES, OVER_PARTICLES)):
            ratios[other].append(_ratio(e.rms(ELLIPSE, name, BANK), e.rms(ELLIPSE, name, other)))
            holds.append(ratios[other][-1] <= most)
    cost = {name: f"1/{e.cheaper(name, ALL_ALIVE):.0f}" for name in BEYOND_EKF}
    flown = {name: f"1/{e.cheaper(name, BANK_LOOP):.0f}" for name in BEYOND_EKF}
    floor, particles = (" / ".join(f"{ratio:.2f}" for ratio in group) for group in ratios.values())
    return Claim(
        "range.bank", "target", "The feasible-set bank finds the pose from anywhere, as exactly as can be.",
        "C.4, Definition C.9",
        f"converged >= {FOUND:g} and " + _each({name: f">= {least:g}" for name, least in BEYOND_EKF.items()})
        + f" times the EKF; RMSE <= {OVER_FLOOR:g} of an EKF from nearby and <= {OVER_PARTICLES:g} of adaptive Monte "
        f"Carlo localisation; an update <= 1/{CHEAPER:g} of 1000 particles', both compiled",
        f"{_each(shares)}; RMSE {floor} of the floor, {particles} of adaptive Monte Carlo localisation's; an update "
        f"with no hypothesis dropped {_each(cost)}, as flown {_each(flown)}; called from Python, {_called(e)}",
        all(holds),
    )  # fmt: skip


def _called(e: ConvergenceResults) -> str:
    """Other plug-ins beside the bank, for the most sensors that were timed."""
    cost = e.costs["4"]
    times = {
        name.removeprefix("range_"): f"{np.median(cost[name] / cost['feasible_set_bank']):.1f}"
        for name in ("range_ekf", "range_ukf", "range_particle")
    }
    return "others' over the bank's: " + _each(times)


def _nonconvex(e: ConvergenceResults) -> Claim:
    sets = [sensors for wall, sensors, _ in e.found if wall == BEAN_WALL]
    shares = {name: e.share(BEAN_WALL, name, BANK) for name in sets}
    return Claim(
        "range.nonconvex", "target", "The bank finds the pose within a wall that is not convex.", "2.2, C.4",
        f"a bean: converged >= {IN_BEAN:g}", _each({name: share.text() for name, share in shares.items()}),
        all(share.value >= IN_BEAN for share in shares.values()),
    )  # fmt: skip


def _diffdrive(e: ConvergenceResults) -> Claim:
    worst = {name: max(e.driven(s, friction) for s, friction in e.drives if s == name) for name in DRIVEN}
    factor = float(1.0 / np.median(e.run_cpu))
    frictions = sorted({friction for _, friction in e.drives})
    runs = [record for records in e.drives.values() for record in records]
    touched = sum(bool(record.summary["touched_wall"]) for record in runs)
    return Claim(
        "range.diffdrive", "target", "On two driven wheels in MuJoCo the robot knows its pose too.", "C.4",
        f"friction >= {min(frictions):g}: RMS <= {DRIVEN['2s']:g} m (2s) and {DRIVEN['4']:g} m (4); "
        f">= {REAL_TIME:g} times real time",
        f"friction {', '.join(f'{friction:g}' for friction in frictions)}: at most "
        f"{_each({name: f'{value:.4f} m' for name, value in worst.items()})}; {factor:.1f} times real time (CPU); "
        f"{touched} of {len(runs)} runs touched the wall",
        all(worst[name] <= most for name, most in DRIVEN.items()) and factor >= REAL_TIME,
    )  # fmt: skip


def _consistency(e: ConvergenceResults) -> Claim:
    found = {name: e.nees(name) for name in BEYOND_EKF}
    nis = {name: f"{e.nis(name, BANK):.3f}" for name in BEYOND_EKF}
    return Claim(
        "range.consistency", "target", "The bank knows how good its estimate is.", "C.4",
        "locked, at the end of the runs: average NEES within its 95 % chi-square bounds",
        _each({name: "none locked" if nees is None else nees.text() for name, nees in found.items()})
        + f"; NIS a ray {_each(nis)}",
        all(nees is not None and nees.holds for nees in found.values()),
    )  # fmt: skip


def _ratio(one: RootMeanSquare | None, other: RootMeanSquare | None) -> float:
    return math.nan if one is None or other is None else one.value / other.value


def _each(texts: Mapping[str, str]) -> str:
    return ", ".join(f"{name}: {text}" for name, text in texts.items())
