"""Flights in space whose heading, target, gusts and true body are drawn, and the bands of their misses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binom

from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import median_band, rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.sweep.trial import Trial, trial

NAME = "drawn, in space"
CONFIDENCE = 0.95
_STREAM = 20061121  # of the draws, beside the number of the flight


def drawn_trial(number: int) -> Trial:
    """The flight of a number: the case SM2 with everything that is drawn from its own stream."""
    rng = np.random.default_rng([_STREAM, number])

    def between(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 4)

    def velocity() -> tuple[float, float, float]:
        speed, course = rng.uniform(0.0, 30.0), rng.uniform(-np.pi, np.pi)
        return round(float(speed * np.cos(course)), 4), round(float(speed * np.sin(course)), 4), 0.0

    turn = (between(1.0, 6.0), *velocity())
    fields: dict[str, Any] = {
        "case": "SM2",
        "dimension": "spatial",
        "start_heading": between(-180.0, 180.0),
        "target": (between(600.0, 1200.0), between(-400.0, 400.0), 0.0),
        "target_velocity": velocity(),
        "target_change": (turn,),
        "target_announcement_delay": 0.2,
        "mismatch.mass": between(0.9, 1.1),
        "mismatch.inertia": between(0.9, 1.1),
        "mismatch.force": between(0.95, 1.05),
        "mismatch.moment": between(0.95, 1.05),
        "gust.force_rms": between(0.0, 400.0),
        "gust.torque_rms": between(0.0, 20.0),
    }
    return trial("missile-guidance", number, fields=fields)


def quantile_limits(values: Array, share: float, confidence: float = CONFIDENCE) -> tuple[float, float, float]:
    """The quantile of a share of values (n,), and order statistics that enclose the population's with a confidence.

    The k-th smallest of n values is below the quantile if at least k of them are: a binomial number. A limit that no
    order statistic is left for is NaN.
    """
    ordered, n = np.sort(values), len(values)
    tail = 0.5 * (1.0 - confidence)
    below, above = int(binom.ppf(tail, n, share)), int(binom.ppf(1.0 - tail, n, share)) + 1
    low = float(ordered[below - 1]) if below >= 1 else float("nan")
    high = float(ordered[above - 1]) if above <= n else float("nan")
    return float(np.quantile(ordered, share)), low, high


def drawn_table(records: Sequence[Record]) -> Table:
    """The misses and aspect errors of the drawn flights: median and 90 %, with their limits."""
    rows = []
    for name, key in (("miss [m]", "miss_m"), ("aspect error [°]", "aspect_error_deg")):
        values = figures(records, key)
        band = median_band(values, np.random.default_rng(0), CONFIDENCE)
        most, low, high = quantile_limits(values, 0.9)
        rows.append(
            (name, _limits(band.median, band.low, band.high), _limits(most, low, high), f"{values.max():.3g}")
        )  # fmt: skip
    grounded = sum(bool(record.summary["hit_ground"]) for record in records)
    hits = rate(sum(bool(record.summary["hit"]) for record in records), len(records))
    rows.append(("hits", hits.text(), f"{grounded} hit the ground", ""))
    return Table("Flights in space with everything drawn", ("", "median", "90 %", "largest"), rows)


def _limits(value: float, low: float, high: float) -> str:
    """A figure with the limits between which it lies, as far as there are any."""
    return f"{value:.2g}" if np.isnan([low, high]).any() else f"{value:.2g} [{low:.2g}, {high:.2g}]"


def drawn_claim(records: Sequence[Record]) -> Claim:
    """Nine in ten flights meet the target, whatever the heading."""
    miss = figures(records, "miss_m")
    hits = sum(bool(record.summary["hit"]) for record in records)
    band = median_band(miss, np.random.default_rng(0), CONFIDENCE)
    most, low, high = quantile_limits(miss, 0.9)
    return Claim(
        "missile.drawn", "target", "Whatever the heading, the target's motion, gusts and the body, it is met.", "B.4",
        "100 draws in space, any heading, a target of up to 30 m/s that turns once, 10 % of mass and inertia, 5 % of "
        "the thrusters, gusts of 400 N and 20 N m: at least 95 % hit (miss <= 1 m), 90 % within .5 m",
        f"{rate(hits, len(records)).text()} hit; miss: median {_limits(band.median, band.low, band.high)} m, 90 % "
        f"{_limits(most, low, high)} m, largest {miss.max():.2g} m",
        bool(hits >= 0.95 * len(records) and most <= 0.5),
    )  # fmt: skip
