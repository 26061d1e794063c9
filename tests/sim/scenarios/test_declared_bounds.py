"""No flight that a scenario accepts leaves the tracking bound it declares without an announcement."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mathnavi.commands.cli import main
from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.full_state import FullState, FullStateConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.fault_fields import AerialFaults
from mathnavi.sim.scenarios.flight_fields import FlightNoise
from mathnavi.sim.scenarios.safe_flight import SafeFlight

ENDS = {"start": (3000.0, 4000.0, 800.0), "target": (6500.0, 6000.0, 900.0)}
ANNOUNCED = {"guarantee-lost", "guarantee-endangered"}


@given(
    faults=st.builds(
        AerialFaults,
        gust_rms=st.sampled_from([0.0, 0.3, 1.0]),
        gust_time_constant=st.sampled_from([1.0 / 300.0, 3.0, 30.0]),
        dropout_rate=st.sampled_from([0.0, 0.5, 0.95]),
    ),
    estimator=st.one_of(
        st.builds(FullStateConfig, rate=st.sampled_from([None, 5.0, 0.5]), timeout=st.sampled_from([0.5, 60.0])),
        st.builds(KalmanConfig, timeout=st.sampled_from([1.0, 20.0])),
    ),
    noise=st.sampled_from([0.0, 3.0]),
    seed=st.integers(0, 1000),
)
@settings(max_examples=6)
@example(AerialFaults(gust_rms=1.0, gust_time_constant=10.0), FullStateConfig(rate=1.0, timeout=60.0), 0.0, 2)
@example(AerialFaults(gust_rms=1.0, gust_time_constant=1.0 / 300.0), KalmanConfig(), 0.0, 2)
@example(AerialFaults(gust_rms=0.3, dropout_rate=0.95), FullStateConfig(timeout=60.0), 0.0, 3)
def test_a_bound_that_is_declared_is_kept_or_its_loss_announced(
    faults: AerialFaults, estimator: Any, noise: float, seed: int
) -> None:
    config = SafeFlight.Config(terrain="jacksboro", **ENDS, noise=FlightNoise(position=noise), faults=faults)
    plugin = PluginSpec.with_fields(FullState if isinstance(estimator, FullStateConfig) else Kalman)
    try:
        closed_loop = SafeFlight.build(config, seed, estimator=dataclasses.replace(plugin, config=estimator))
    except ValueError:
        return  # refused: nothing is left to plan with
    run = closed_loop.run()
    kept = run.summary["tracking_breaches"] == 0 and run.summary["min_clearance_m"] >= config.clearance_min
    assert kept or ANNOUNCED & {event.kind for event in run.recording.events}
    assert run.summary["ground_contacts"] == 0


def test_readings_too_rare_for_the_declared_gusts_are_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    flags = "--terrain jacksboro --estimator.rate 0.1 --estimator.timeout 60 --faults.gust-rms 1"
    assert main(["run", "safe-flight", *flags.split(), "--faults.gust-time-constant", "10"]) == 2
    error = capsys.readouterr().err
    assert "10 s without a reading" in error
    assert "acceleration-max = 40" in error
