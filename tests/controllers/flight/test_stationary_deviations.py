"""The deviations behind the tracking bound are those of a loop with held commands, held gusts and old readings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.flight.tracker import stationary_deviations
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.sensor_faults import longest_gap, rms_gap
from tests import flight

H = 1.0 / 60.0  # [s] of commands and gusts
BANDWIDTH = 0.8  # [rad/s]
AXES, SECONDS = 4000, 40.0


def flown(mission: FlightMission, gust: DeclaredGusts, rate: float | None, dropout: float) -> np.ndarray:
    """Greatest standard deviations (2,) of position and velocity over the last 10 s, of independent axes at hover."""
    rng = np.random.default_rng(1)
    every = 1 if rate is None else round(1.0 / (rate * H))
    keep = math.exp(-H / gust.time_constant)
    stir = gust.rms * math.sqrt(1.0 - keep**2)
    p, v, u, g = (np.zeros(AXES) for _ in range(4))
    p_read, v_read, g = np.zeros(AXES), np.zeros(AXES), gust.rms * rng.standard_normal(AXES)
    worst = np.zeros(2)
    for k in range(round(SECONDS / H)):
        if k % every == 0:
            heard = rng.random(AXES) >= dropout
            p_read, v_read = np.where(heard, p, p_read), np.where(heard, v, v_read)
        u = -(BANDWIDTH**2) * p_read - 2.0 * BANDWIDTH * v_read
        if k * H > SECONDS - 10.0:
            worst = np.maximum(worst, [p.std(), v.std()])
        p, v = p + H * v + 0.5 * H * H * (u + g), v + H * (u + g)
        p_read, v_read = p_read + H * v_read + 0.5 * H * H * u, v_read + H * u
        g = keep * g + stir * rng.standard_normal(AXES)
    return worst


@pytest.mark.parametrize(
    ("rms", "time_constant", "rate"),
    [(1.0, 3.0, None), (1.0, 10.0, 1.0), (0.5, 3.0, 0.5), (1.0, 10.0, 0.1), (3.0, 1.0 / 300.0, None)],
    ids=["fresh", "a second old", "two seconds old", "ten seconds old", "gusts faster than a command"],
)
def test_the_deviations_are_those_that_are_flown(rms: float, time_constant: float, rate: float | None) -> None:
    gust = DeclaredGusts(rms, time_constant)
    mission = flight.mission(gust=gust.held(H))
    quality = mission.full_state_quality(rate, 60.0)
    declared = stationary_deviations(BANDWIDTH, quality, mission.gust)[:2]
    np.testing.assert_allclose(flown(mission, gust, rate, 0.0), declared, rtol=0.08)


@pytest.mark.parametrize("dropout", [0.3, 0.9])
def test_lost_readings_stay_within_what_is_declared(dropout: float) -> None:
    gust = DeclaredGusts(1.0, 3.0)
    mission = flight.mission(gust=gust.held(H), dropout_rate=dropout)
    quality = mission.full_state_quality(None, 5.0)
    declared = stationary_deviations(BANDWIDTH, quality, mission.gust)[:2]
    assert (flown(mission, gust, None, dropout) <= 1.05 * np.array(declared)).all()


def test_gaps_between_readings() -> None:
    assert longest_gap(0.1, 0.0, 5.0) == pytest.approx(0.1)
    assert longest_gap(10.0, 0.0, 5.0) == 5.0
    assert longest_gap(0.1, 1.0, 5.0) == rms_gap(0.1, 1.0, 5.0) == 5.0
    gaps = np.random.default_rng(0).geometric(0.4, 200_000)  # of lost readings and the one that is heard
    assert rms_gap(1.0, 0.6, 60.0) == pytest.approx(math.sqrt(np.square(gaps).mean()), rel=0.02)
    assert gaps.max() <= longest_gap(1.0, 0.6, 1e3)


def test_a_slow_gust_is_held_as_it_is_and_a_fast_one_is_slower_held() -> None:
    assert DeclaredGusts(1.0, 3.0).held(H).time_constant == pytest.approx(3.0, rel=1e-5)
    assert DeclaredGusts(1.0, 1e-4).held(H).time_constant == pytest.approx(0.5 * H)
