"""Velocity filters on logs of arms: a motion whose velocity is known, and what an observer says of itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.errors import LogError
from mathnavi.studies.real import arm_filters
from mathnavi.studies.real.arm_filters import ArmLog, best, compare, constant_acceleration, low_pass, ur10e_log
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
    tuned = best(log, arm_filters.JERKS, lambda own, s: constant_acceleration(own, s, 1e-4))
    assert arm_filters.JERKS[0] < tuned < arm_filters.JERKS[-1]
    assert log.error(constant_acceleration(log, tuned, 1e-4)) < 0.01


def test_it_compares_all_filters_on_another_log(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arm_filters, "BANDWIDTHS", (25.0,))
    (found,) = compare(recorded(0), [recorded(100, 5.0)], "two-link", ("q0", "q1"), ("i0", "i1"))
    butterworth = found["Butterworth of differences"].error
    assert found["momentum_observer"].error < 0.5 * butterworth
    assert found["riemannian_observer"].error < butterworth
    assert found["riemannian_observer"].judged["wrong_share"] < 0.05
    assert found["riemannian_observer"].judged["usable_share"] > 0.9
    assert 0.01 < found["riemannian_observer"].judged["nees"] < 10.0


def test_a_table_of_the_ur10e_has_positions_first_and_torques_last(tmp_path: Path) -> None:
    file = tmp_path / "ur.csv"
    file.write_text("\n".join(",".join(str(100 * k + n) for n in range(31)) for k in range(3)))
    log = ur10e_log(str(file))
    np.testing.assert_array_equal(log["arm"].t, [0.0, 100.0, 200.0])
    np.testing.assert_array_equal(log["arm"].values[0], [1, 2, 3, 4, 5, 6, 25, 26, 27, 28, 29, 30])
    file.write_text("1,2,3")
    with pytest.raises(LogError, match="line 1: '1,2,3'; allowed: 31 numbers"):
        ur10e_log(str(file))
