"""Velocity filters of the comparison on logs of arms, on a motion whose velocity is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import arm_log
from benchmarks.arm_log import ArmLog, best, constant_acceleration, low_pass
from tests.sim.logs.test_identification import recorded


def sine(noise: float) -> ArmLog:
    """Log of one joint at 100 Hz, sin(2 t), with its true velocity as the reference."""
    t = np.arange(0.0, 12.0, 0.01)
    q = np.sin(2.0 * t) + noise * np.random.default_rng(0).standard_normal(len(t))
    return ArmLog(t, q[:, np.newaxis], np.zeros((len(t), 1)), 2.0 * np.cos(2.0 * t)[:, np.newaxis])


def test_a_low_pass_lags_by_its_group_delay() -> None:
    """Butterworth's of second order lags by sqrt(2) / (2 pi f), differences by half a period."""
    lag = np.sqrt(2.0) / (2.0 * np.pi * 8.0) + 0.005
    assert sine(0.0).error(low_pass(sine(0.0), 8.0)) == pytest.approx(4.0 * lag / np.sqrt(2.0), rel=0.03)


def test_a_kalman_filter_is_best_at_a_jerk_between_noise_and_lag() -> None:
    log = sine(1e-4)
    tuned = best(log, arm_log.JERKS, lambda own, s: constant_acceleration(own, s, 1e-4))
    assert arm_log.JERKS[0] < tuned < arm_log.JERKS[-1]
    assert log.error(constant_acceleration(log, tuned, 1e-4)) < 0.01


def test_it_compares_all_filters_on_another_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arm_log, "BANDWIDTHS", (25.0,))
    for name, log in (("a.csv", recorded(0)), ("b.csv", recorded(100, 5.0))):
        table = log.channels["table"]
        rows = np.column_stack([table.t, table.values])
        np.savetxt(tmp_path / name, rows, delimiter=",", header="t,q0,q1,i0,i1", comments="")
    found = arm_log.compare(arm_log.Arguments(tmp_path / "a.csv", tmp_path / "b.csv", "two-link", "q0,q1", "i0,i1"))
    errors = {name: error for name, (_, error) in found.items()}
    assert errors["momentum_observer"] < 0.5 * errors["Butterworth of differences"]
    assert errors["riemannian_observer"] < errors["Butterworth of differences"]
