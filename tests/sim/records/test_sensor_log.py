"""Estimators over a log of one's own, and what is said of a log that is wrong."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.reading_counts import COUNTS
from mathnavi.interfaces.signals import Array, Estimate, Status

WALL, ANGLES, DT = mn.ellipse(3.0, 2.0), (0.0, 1.5), 0.05
MISSION = mn.RangingMission(
    WALL, ANGLES, mn.RangeQuality(absolute=0.01), period=DT, start=mn.KnownStart((1.0, 0.5, 0.3))
)


def driven(n: int = 60) -> tuple[Array, Array, Array, Array]:
    """Times (n,), poses (n, 3), ranges (n, 2) and inputs (n, 2) of a circle; inputs[k] acts from t[k] on."""
    t, u = DT * np.arange(n), np.array([0.4, 0.5])
    poses = [np.array([1.0, 0.5, 0.3])]
    for _ in range(n - 1):
        poses.append(MISSION.flow(poses[-1], u, DT))
    ranges = np.array([WALL.ranges(pose, ANGLES)[0] for pose in poses])
    return t, np.array(poses), ranges, np.tile(u, (n, 1))


def good(**changes: Any) -> mn.SensorLog:
    t, _, ranges, u = driven()
    fields: dict[str, Any] = {"t": t, "readings": {"ranges": ranges, "odometry": u}, "inputs": None, **changes}
    return mn.SensorLog(**fields)


@pytest.mark.honoured("sensor log", "times, readings by sensor, inputs")
@pytest.mark.parametrize("method", ["feasible_set_bank", "range_ekf", "range_iekf"])
def test_any_estimator_of_the_mission_runs_over_a_log(method: str) -> None:
    t, poses, _, _ = driven()
    found = mn.estimate(method, MISSION, good())
    np.testing.assert_array_equal(found.t, t)
    assert found.x.shape == found.deviation.shape == (60, 3)
    assert found.covariance.shape == (60, 3, 3)
    np.testing.assert_allclose(found.x[-1], poses[-1], atol=0.02)
    assert found.ok[-1]
    assert found.extra["nis"].shape == (60, 2)
    assert method in repr(found)


@pytest.mark.honoured("sensor log", "times, readings by sensor, inputs")
@pytest.mark.parametrize("method", ["rts", "batch"])
def test_a_smoother_uses_the_readings_to_come(method: Any) -> None:
    t, poses, ranges, u = driven()
    noise = np.random.default_rng(0).normal(0.0, 0.05, ranges.shape)
    mission = dataclasses.replace(MISSION, ranging=mn.RangeQuality(absolute=0.05))
    log = mn.SensorLog(t, {"ranges": ranges + noise, "odometry": u})
    filtered = mn.estimate("range_ekf", mission, log)
    smoothed = mn.estimate(mn.smoother("range_ekf", method=method), mission, log)

    def error(found: mn.EstimateHistory) -> float:
        return float(np.sqrt(np.mean((found.x - poses)[:, :2] ** 2)))

    assert error(smoothed) < 0.9 * error(filtered)
    assert (smoothed.deviation[10:30] < filtered.deviation[10:30]).all()
    if method == "rts":  # at the end there are no readings to come; batch least squares is linearised elsewhere
        np.testing.assert_allclose(smoothed.x[-1], filtered.x[-1], atol=1e-9)
    assert "smoother" in repr(smoothed)


def test_what_cannot_be_smoothed_is_refused() -> None:
    with pytest.raises(mn.FieldError, match="allowed: kalman, missile_kalman, range_ekf"):
        mn.smoother("feasible_set_bank")
    with pytest.raises(mn.FieldError, match="method = 'best'"):
        mn.smoother("range_ekf", method="best")  # type: ignore[arg-type]
    with pytest.raises(mn.PluginError, match="'smoother' is not known"):
        mn.estimate("smoother", MISSION, good())


def test_a_smoother_without_a_reading_waits_for_one() -> None:
    blind = np.full((60, 2), np.nan)
    log = good(readings={"ranges": blind, "odometry": blind})
    found = mn.estimate(mn.smoother("range_ekf"), dataclasses.replace(MISSION, start=None), log)
    assert set(found.status) == {Status.INITIALISING}


@pytest.mark.honoured("sensor log", "inputs that act from their times on")
def test_an_input_acts_from_its_time_on() -> None:
    """Without odometry the command moves the robot: one that stops at t[30] is at rest from then on."""
    t, poses, ranges, u = driven()
    u[30:] = 0.0
    blind = {"ranges": np.where(np.arange(60)[:, None] < 1, ranges, np.nan), "odometry": np.full((60, 2), np.nan)}
    found = mn.estimate("range_iekf", MISSION, mn.SensorLog(t, blind, u))
    np.testing.assert_allclose(found.x[30] - found.x[0], poses[30] - poses[0], atol=0.01)
    np.testing.assert_array_equal(found.x[31:], np.tile(found.x[30], (29, 1)))


@pytest.mark.honoured("sensor log", "rows of NaN, and single values of NaN in partial readings")
def test_a_row_of_nan_is_no_reading_and_a_single_range_may_be_lost() -> None:
    _, _, ranges, u = driven()
    ranges[5], ranges[7, 1] = np.nan, np.nan
    found = mn.estimate("range_iekf", MISSION, good(readings={"ranges": ranges, "odometry": u}))
    np.testing.assert_array_equal(found.extra["nis"][[4, 7], 1], [2.0, 1.0])
    assert np.isnan(found.extra["nis"][5, 1])


def test_a_csv_file_is_the_log_that_its_columns_hold(tmp_path: Path) -> None:
    t, _, ranges, u = driven()
    path = tmp_path / "robot.csv"
    lines = ["w, time ,left,v,front,note"]
    lines += [
        f"{w!r},{s!r},{b!r},{v!r},{a!r},x"
        for s, (a, b), (v, w) in zip(t.tolist(), ranges.tolist(), u.tolist(), strict=True)
    ]
    path.write_text("\ufeff" + "\n".join(lines).replace(repr(ranges[3, 1].item()), "") + "\n\n", encoding="utf-8")
    sensors = {"ranges": ["front", "left"], "odometry": ["v", "w"]}
    log = mn.SensorLog.from_csv(path, time="time", readings=sensors, inputs=["v", "w"])
    np.testing.assert_array_equal(log.t, t)
    expected = ranges.copy()
    expected[3, 1] = np.nan
    np.testing.assert_array_equal(log.readings["ranges"], expected)
    np.testing.assert_array_equal(log.inputs, u)
    assert "60 times from 0 to 2.95 s" in repr(log)


def with_value(values: Array, place: Any, value: float) -> Array:
    changed = values.copy()
    changed[place] = value
    return changed


T, _, RANGES, U = driven()
READINGS = {"ranges": RANGES, "odometry": U}
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "times that are not finite": ({"t": with_value(T, 17, np.nan)}, r"log: t\[17\] = nan; allowed: finite"),
    "times that go back": (
        {"t": with_value(T, 18, 0.3)},
        r"t\[18\] = 0\.3 s comes after t\[17\] = 0\.85 s; allowed: times",
    ),
    "times that stand still": ({"t": with_value(T, 1, 0.0)}, r"t\[1\] = 0 s comes after t\[0\] = 0 s"),
    "no times": ({"t": [], "readings": {}}, r"t is empty"),
    "times that are no numbers": ({"t": ["a"]}, r"t holds values that are not numbers"),
    "readings with another number of rows": ({"readings": {"ranges": RANGES[:9]}}, r"ranges has 9 rows; allowed: 60"),
    "readings with another number of dimensions": (
        {"readings": {"ranges": RANGES[None]}},
        r"ranges has the shape \(1, 60, 2\)",
    ),
    "inputs that are not finite": (
        {"inputs": with_value(U, (4, 1), np.inf)},
        r"inputs\[4, 1\] = inf at 0\.2 s; allowed: finite",
    ),
    "readings of a sensor that are missing": (
        {"readings": {"ranges": RANGES}},
        r"no readings 'odometry', which range_iekf reads; it has ranges",
    ),
    "readings with another number of columns": (
        {"readings": {**READINGS, "ranges": RANGES[:, :1]}},
        r"ranges has 1 columns; allowed: 2",
    ),
    "rows that are NaN in part": (
        {"readings": {**READINGS, "odometry": with_value(U, (6, 0), np.nan)}},
        r"odometry\[6, 0\] = nan at 0\.3 s; allowed: a finite number, or a row of NaN",
    ),
    "inputs with another number of columns": ({"inputs": U[:, :1]}, r"inputs has 1 columns; allowed: 2"),
    "times in another unit": ({"t": 1000.0 * T}, r"step is 50 s .* of the log, or read the log with time_unit='ms'"),
    "another period than the mission's": (
        {"t": 4.0 * T},
        r"median step is 0\.2 s and the period of range_iekf is 0\.05 s; allowed: within",
    ),
}


@pytest.mark.parametrize(
    "wrong", [pytest.param(name, marks=pytest.mark.refused("sensor log", name), id=name) for name in sorted(WRONG)]
)
def test_what_is_wrong_with_a_log_is_named_with_its_place(wrong: str) -> None:
    changes, message = WRONG[wrong]
    with pytest.raises(mn.LogError, match=message):
        mn.estimate("range_iekf", MISSION, good(**changes))


def test_a_method_or_a_field_that_there_is_not_is_refused() -> None:
    with pytest.raises(mn.PluginError, match="range_iekff"):
        mn.estimate("range_iekff", MISSION, good())
    with pytest.raises(mn.FieldError, match="timeout"):
        mn.estimate("range_iekf", MISSION, good(), timeout=-1.0)
    with pytest.raises(mn.PluginError):
        mn.estimate("attitude_iekf", MISSION, good())


def test_a_plugin_with_fields_is_a_method_too() -> None:
    found = mn.estimate(
        mn.plugin("range_iekf", timeout=0.01), MISSION, good(t=T + np.where(np.arange(60) > 30, 1.0, 0.0))
    )
    assert found.ok[:31].all()
    assert found.status[31] is Status.DEGRADED, "a second without a reading is longer than declared"
    assert found.usable.all()


@pytest.mark.honoured("sensor log", "readings that are not used")
def test_readings_that_are_not_used_are_counted_by_reason_and_said() -> None:
    _, _, ranges, u = driven()
    ranges[5, 1], ranges[6] = 50.0, ranges[6] + 1.5
    u[8], u[9] = 100.0, 100.0
    readings = {"ranges": ranges, "odometry": u, "sonar": u[:, :1]}
    found = mn.estimate("range_iekf", MISSION, good(readings=readings, inputs=U))
    assert found.unused == {"outlier": 2, "out of range": 3, "unknown sensor": 60}
    np.testing.assert_array_equal(found.extra[COUNTS][[4, 5, 7, 8, 9], 1], [0, 1, 1, 2, 3])
    assert "readings not used  2 outlier, 3 out of range" in repr(found)
    assert "60 of sonar" in found._repr_html_()
    assert "not used" not in repr(mn.estimate("range_iekf", MISSION, good()))


def test_an_estimator_that_waits_says_for_what() -> None:
    _, _, ranges, u = driven()
    mission = dataclasses.replace(MISSION, start=None)
    blind = good(readings={"ranges": np.where([True, False], np.nan, ranges), "odometry": u})
    found = mn.estimate("feasible_set_bank", mission, blind)
    assert found.message[3] == "waits for 10 readings to average: it has 4"
    assert "waits for ranges of 2 beams at one pose: it has 1" in repr(found)


class Stranger:
    """An estimator of somebody else's, which keeps the commands that it gets."""

    @configuration
    class Config:
        """Fields."""

    period = DT
    build = staticmethod(lambda config, mission: Stranger())
    sensors = staticmethod(lambda config, mission: ())
    quality = staticmethod(lambda config, mission: None)

    def update(self, t: float, measurements: object, command: Array) -> Estimate:
        return Estimate(t, np.zeros(2), extra={"command": command.copy()})


@pytest.mark.honoured("sensor log", "log without inputs")
def test_inputs_are_zero_if_not_given_for_anybodys_estimator_and_mission() -> None:
    """A mission that does not say how many inputs there are has none."""
    np.testing.assert_array_equal(mn.estimate(Stranger, MISSION, good()).extra["command"], np.zeros((60, 2)))
    assert mn.estimate(Stranger, object(), good()).extra["command"].shape == (60, 0)
    given = mn.estimate(Stranger, object(), good(inputs=U)).extra["command"]
    np.testing.assert_array_equal(given, np.vstack([np.zeros(2), U[:-1]]))


@pytest.mark.refused("plug-in", "class without Config")
def test_a_class_without_a_configuration_is_refused_by_its_name() -> None:
    with pytest.raises(mn.PluginError, match=r"'.*Bare' declares no frozen dataclass named Config"):
        mn.estimate(type("Bare", (), {}), MISSION, good())


def test_an_estimator_that_fails_is_named_with_the_time() -> None:
    @configuration
    class Fields:
        pass

    class Failing:
        Config, period = Fields, 0.05
        build = staticmethod(lambda config, mission: Failing())
        sensors = staticmethod(lambda config, mission: ())
        quality = staticmethod(lambda config, mission: 0.0)

        def update(self, t: float, measurements: object, command: object) -> None:
            raise IndexError("three inputs")

    with pytest.raises(mn.PluginError, match=r"Failing'?: update\(\) at 0 s failed: IndexError: three inputs"):
        mn.estimate(Failing, MISSION, good())
