"""Recorded logs: stamps as they came, and what becomes of them on the way to an estimator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

import mathnavi as mn
from mathnavi.interfaces.signals import Array
from mathnavi.sim.logs.timing import longest_constant, timing_of


def channel(t: Sequence[float], *signals: str, values: Array | None = None) -> mn.Channel:
    """A channel whose values count its readings."""
    own = np.arange(float(len(t) * len(signals))).reshape(len(t), len(signals)) if values is None else values
    return mn.Channel(np.array(t, float), own, signals)


def log(**channels: mn.Channel) -> mn.RecordedLog:
    return mn.RecordedLog("robot.log", "test", channels, "clock")


@given(some.permutations(range(12)), some.lists(some.integers(0, 11), max_size=4))
def test_late_and_doubled_stamps_are_all_counted(order: list[int], again: list[int]) -> None:
    t = np.array([*order, *again], float)
    timing = timing_of(t)
    late = [k for k in range(1, len(t)) if t[k] < t[:k].max()]
    assert timing.late == len(late)
    assert timing.first_late == (late[0] if late else None)
    assert timing.doubled == len(again)
    assert timing.orderly == (not late and not again)
    assert (timing.first, timing.last, timing.rate, timing.missing) == (0.0, 11.0, 1.0, 0)


def test_a_gap_counts_what_is_missing_in_it() -> None:
    t = np.delete(0.1 * np.arange(100), [*range(20, 30), 50, 51])
    timing = timing_of(t)
    assert (timing.gaps, timing.missing) == (2, 12)
    assert (timing.longest_gap, timing.longest_gap_at) == pytest.approx((1.1, 1.9))


def test_a_stuck_number_is_seen_in_the_order_of_stamps() -> None:
    t = np.array([0.0, 1.0, 9.0, 2.0, 3.0, 4.0, 5.0])
    values = np.array([1.0, 2.0, 3.0, 2.0, np.nan, 2.0, 7.0])
    assert longest_constant(t, values) == (3.0, 1.0)
    assert longest_constant(t, np.full(7, np.nan))[0] == 0.0


def test_channels_of_several_rates_meet_at_all_of_their_stamps() -> None:
    recorded = log(
        wheels=channel([0.0, 0.1, 0.2, 0.3], "v [m/s]", "w [deg/s]"), scan=channel([0.05, 0.2], "r 0 [m]", "r 1 [mm]")
    )
    found = recorded.sensor_log(readings={"odometry": "wheels", "ranges": ["r 0", "scan:r 1"]})
    assert found.t.tolist() == [0.0, 0.05, 0.1, 0.2, 0.3]
    assert np.isnan(found.readings["odometry"][1]).all()
    assert found.readings["ranges"][[1, 3]].tolist() == [[0.0, 1e-3], [2.0, 3e-3]]
    assert np.allclose(found.readings["odometry"][[0, 2, 3, 4], 1], np.deg2rad([1.0, 3.0, 5.0, 7.0]))


def test_an_input_acts_until_the_next_one_and_nothing_is_said_before_the_first() -> None:
    recorded = log(angle=channel([0.0, 0.1, 0.2, 0.3], "q [rad]"), torque=channel([0.1, 0.25], "u [N m]"))
    found = recorded.sensor_log(readings={"position": "angle"}, inputs="torque")
    assert found.t.tolist() == [0.1, 0.2, 0.25, 0.3]
    assert found.inputs is not None
    assert found.inputs.ravel().tolist() == [0.0, 0.0, 1.0, 1.0]
    assert found.notes == ("1 time before the first input, at 0.1 s, left out",)


def test_stamps_that_do_not_increase_are_refused_with_their_place_or_sorted_and_counted() -> None:
    recorded = log(wheels=channel([0.0, 0.2, 0.1, 0.2], "v"))
    with pytest.raises(mn.LogError) as refused:
        recorded.sensor_log(readings={"odometry": "v"})
    assert str(refused.value) == (
        "robot.log: channel 'wheels' has 1 stamp before an earlier one, the first is number 2, 0.1 s after 0.2 s, and "
        "1 stamp that an earlier reading has; disorder='sort' sorts them"
    )
    found = recorded.sensor_log(readings={"odometry": "v", "speed": "v"}, disorder="sort")
    assert (found.t.tolist(), found.readings["odometry"].ravel().tolist()) == ([0.0, 0.1, 0.2], [0.0, 2.0, 1.0])
    assert found.notes == (
        "wheels: 1 stamp before an earlier one, sorted",
        "wheels: 1 reading left out, whose stamp an earlier one has",
    )


def test_readings_of_several_beacons_are_told_apart() -> None:
    values = np.array([[5.0, 10.0], [6.0, 20.0], [5.0, 11.0]])
    beacons = log(uwb=channel([0.0, 0.1, 0.2], "node", "range [m]", values=values)).split("uwb", by="node")
    assert {name: each.values.ravel().tolist() for name, each in beacons.channels.items()} == {
        "uwb node=5": [10.0, 11.0],
        "uwb node=6": [20.0],
    }
    values[1, 0] = 5.5
    with pytest.raises(mn.LogError, match=r"uwb:node is 5.5 in row 1; allowed: whole numbers"):
        log(uwb=channel([0.0, 0.1, 0.2], "node", "range [m]", values=values)).split("uwb", by="node")


def test_of_a_table_only_the_signals_that_count_are_divided_and_a_note_says_so() -> None:
    values = np.array([[1.0, 5.0, 0.1], [2.0, 6.0, 0.3]])
    table = log(table=channel([0.0, 0.5], "wheel_step [m]", "uwb_A1", "turn_step", values=values))
    made = table.rates("wheel_step").rates("turn_step")
    own = made.channels["table"]
    assert own.signals == ("wheel_step [m/s]", "uwb_A1", "turn_step")
    assert own.values[1].tolist() == pytest.approx([4.0, 6.0, 0.6])
    assert own.values[:, 1].tolist() == [5.0, 6.0]
    assert made.notes[-1] == "table: turn_step over the time since the row before, as was asked"
    with pytest.raises(mn.LogError, match="it has no signal 'wheel'"):
        table.rates("wheel")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"readings": {}}, "readings is empty"),
        ({"readings": {"a": []}}, "a has no signal"),
        ({"readings": {"a": "speed"}}, "it has no signal 'speed'"),
        ({"readings": {"a": "wheels:speed"}}, "channel 'wheels' has no signal 'speed'"),
        ({"readings": {"a": "v"}}, "several signals are called 'v'; allowed: wheels:v, gps:v"),
        ({"readings": {"a": ["wheels:v", "wheels:v"]}}, "a takes wheels:v twice; allowed: each signal once"),
        ({"readings": {"a": ["wheels:v", "gps:v"]}}, "which were not read at the same times"),
        ({"readings": {"a": "gps:odd"}}, "the unit of gps:odd [furlong] is not known"),
        ({"readings": {"a": "wheels:v"}, "units": {"gps:v": "parsec"}}, "units = {'gps:v': 'parsec'}; allowed"),
        (
            {"readings": {"a": "wheels:v"}, "inputs": "gps:odd", "units": {"odd": "m"}},
            "an input at 0.1 s is not finite",
        ),
        ({"readings": {"a": "wheels:v"}, "disorder": "mend"}, "disorder = 'mend'; allowed: refuse, sort"),
    ],
)
def test_what_does_not_fit_is_named(arguments: dict[str, object], said: str) -> None:
    gps = channel([0.1], "v", "odd [furlong]", values=np.array([[1.0, np.nan]]))
    with pytest.raises(ValueError, match=r".") as refused:
        log(wheels=channel([0.0, 0.1], "v"), gps=gps).sensor_log(**arguments)  # type: ignore[arg-type]
    assert said in str(refused.value)


def test_a_unit_that_is_given_stands_before_that_of_the_file() -> None:
    recorded = log(gyro=channel([0.0, 0.1], "rate [furlong]"))
    found = recorded.sensor_log(readings={"imu": "rate"}, units={"rate": "deg"})
    assert found.readings["imu"][1, 0] == np.deg2rad(1.0)


def test_a_channel_of_the_wrong_shape_or_clock_is_refused() -> None:
    good = channel([0.0, 1.0], "v")
    for wrong in ({"signals": ("v", "w")}, {"t": np.array([0.0])}, {"t": np.array([0.0, np.nan])}):
        with pytest.raises(mn.LogError):
            replace(good, **wrong)  # type: ignore[arg-type]
    with pytest.raises(mn.LogError, match="there is no channel 'weels'; did you mean wheels"):
        log(wheels=good)["weels"]
