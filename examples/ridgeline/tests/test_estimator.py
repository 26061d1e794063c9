"""The filter is better than the raw readings, and as good as it says."""

from __future__ import annotations

import numpy as np
import pytest
from ridgeline.controller import Roadmap
from ridgeline.estimator import AlphaBetaGamma, AlphaBetaGammaConfig

from mathnavi.interfaces.signals import Measurement
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.plugin.registry import PluginSpec, load
from mathnavi.sim.scenarios.fault_fields import AerialFaults
from mathnavi.sim.scenarios.flight_fields import FlightNoise
from mathnavi.sim.scenarios.safe_flight import SafeFlight


def errors(noise: float, gust_rms: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3, 3) errors of position, velocity and gust just before each fix, and the deviations (3,) that are declared.

    The vehicle sways, with gusts of the declared model that change at the fixes.
    """
    rng = np.random.default_rng(4)
    gusts = DeclaredGusts(gust_rms, 3.0, np.inf)
    ground = HeightField(np.zeros((2, 2)), 5000.0)
    mission = FlightMission(ground, (9.0, 8.0, 700.0), (0.0,) * 3, position_noise=noise, gust=gusts, control_period=0.1)
    config = AlphaBetaGammaConfig()
    estimator = AlphaBetaGamma.build(config, mission)
    x, u, gust, found = mission.start_state, np.zeros(3), np.zeros(3), []
    held = np.exp(-mission.control_period / gusts.time_constant)
    before = None
    for k in range(round(seconds / mission.control_period)):
        t = k * mission.control_period
        if before is not None:  # what it would say without the fix
            found.append([before[0] - x[:3], before[1] - x[3:], before[2] - gust])
        estimator.update(t, [Measurement("position", t, x[:3] + noise * rng.standard_normal(3))], u)
        u = np.array([np.cos(t), np.sin(0.7 * t), 0.3])
        gust = held * gust + np.sqrt(1.0 - held**2) * gust_rms * rng.standard_normal(3)
        x = flow(x, u + gust, mission.control_period)
        said = estimator.update(t + mission.control_period - 1e-6, [], u)
        before = said.x[:3], said.x[3:], said.extra["gust"]
    return np.array(found), np.sqrt(np.diag(AlphaBetaGamma.quality(config, mission).error))


def test_in_flight_it_is_better_than_the_full_state_sensor_and_the_tracking_bound_is_kept() -> None:
    way = (3000.0, 4000.0, 900.0), (6000.0, 7000.0, 1000.0)
    noisy = SafeFlight.Config("jacksboro", *way, noise=FlightNoise(position=5.0), faults=AerialFaults(gust_rms=0.5))
    deviation = {}
    for name, estimator in (("full", load("estimators", "full_state")), ("own", AlphaBetaGamma)):
        outcome = SafeFlight.build(
            noisy, seed=3, controller=PluginSpec.with_fields(Roadmap), estimator=PluginSpec.with_fields(estimator)
        ).run()
        assert outcome.success
        assert outcome.summary["tracking_breaches"] == 0
        arrays = outcome.arrays
        n = len(arrays["estimate.x"]) // 2  # from half way on
        deviation[name] = np.std(arrays["estimate.x"][n : 2 * n, :3] - arrays["truth.x"][n : 2 * n, :3])
    assert deviation["own"] < 0.5 * deviation["full"]


@pytest.mark.parametrize(("noise", "gust_rms"), [(5.0, 0.0), (5.0, 1.0), (0.5, 2.0)])
def test_its_errors_are_as_large_as_it_declares(noise: float, gust_rms: float) -> None:
    found, declared = errors(noise, gust_rms, 250.0)
    spread = found[100:].std(axis=(0, 2))
    assert np.all(spread < 1.15 * declared)
    assert np.all(spread > 0.6 * declared)


def test_without_noise_and_gusts_it_stays_on_the_truth() -> None:
    found, _ = errors(0.0, 0.0, 20.0)
    np.testing.assert_allclose(found, 0.0, atol=1e-4)


def test_a_field_out_of_range_is_refused_by_its_name() -> None:
    with pytest.raises(ValueError, match=r"memory = -1\.0.*allowed"):
        AlphaBetaGammaConfig(memory=-1.0)
