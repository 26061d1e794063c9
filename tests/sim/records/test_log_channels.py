"""Channels of a log hold each of its numbers, at its time."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.log_channels import Channel, channels_of
from mathnavi.sim.records.run_folder import RunLog

STATES = ("position_x [m]", "velocity_x [m/s]")


def log_of(arrays: dict[str, Array]) -> RunLog:
    return RunLog(
        None, {}, {}, (), arrays["t"], arrays["truth.x"], arrays["command.u"], (), np.empty(0), arrays  # type: ignore[arg-type]
    )  # fmt: skip


def log_arrays(rng: np.random.Generator) -> dict[str, Array]:
    """Five samples, with a sensor that is read at times, two estimates and two plans."""
    ranges = rng.normal(size=(5, 2))
    ranges[[0, 3]] = np.nan  # not read
    ranges[2, 1] = np.nan  # one of both lost
    return {
        "t": np.arange(5) / 3.0,
        "truth.x": rng.normal(size=(5, 2)),
        "truth.activation": rng.normal(size=(5, 1)),
        "command.u": rng.normal(size=(5, 1)),
        "measurement.ranges": ranges,
        "estimate.t": np.array([0.0, 1.0 / 3.0]),
        "estimate.x": rng.normal(size=(2, 2)),
        "estimate.covariance": rng.normal(size=(2, 2, 2)),
        "plan.offsets": np.array([0, 2, 5]),
        "plan.t": rng.normal(size=5),
        "plan.x": rng.normal(size=(5, 2)),
        "plan.u": rng.normal(size=(5, 1)),
        "plan.phase": np.array([0, -1, 0, 1, -1]),
        "plan.adopted": np.array([0.0, 1.0]),
        "plan.cost": np.array([np.inf, 2.0]),
        "cramer_rao.deviation": rng.normal(size=(5, 2)),
    }


def made_again(channels: list[Channel], t: Array) -> dict[str, Array]:
    """The arrays of a log that are in channels of one vehicle."""
    found: dict[str, Array] = {}
    for channel in channels:
        for field in channel.fields:
            rows = np.asarray(field.rows) if field.shape is not None else np.concatenate(field.rows)
            if channel.name.startswith("readings/"):
                whole = np.full((len(t), *rows.shape[1:]), np.nan)
                whole[np.searchsorted(t, channel.t)] = rows
                rows = whole
            found[field.array] = rows
        if channel.name == "plan":
            found |= {"plan.adopted": channel.t, "plan.offsets": np.cumsum([0, *map(len, channel.fields[0].rows)])}
        if channel.name in ("truth", "estimate"):
            found["t" if channel.name == "truth" else "estimate.t"] = channel.t
    return found


def test_each_number_of_a_log_is_in_a_channel_at_its_time() -> None:
    arrays = log_arrays(np.random.default_rng(1))
    channels = channels_of({"robot": log_of(arrays)}, {"robot": SignalNames(STATES)}, {"robot": ("a [N]",)})
    found = made_again(channels, arrays["t"])
    assert found.keys() == arrays.keys()
    for name, rows in arrays.items():
        np.testing.assert_array_equal(found[name], rows, err_msg=name)
        assert found[name].dtype == rows.dtype
    truth, activation = channels[0].fields
    assert (truth.columns, activation.columns) == (STATES, ("a [N]",))
    assert channels[0].path == ("truth",)


def test_the_vehicles_of_a_fleet_have_channels_each() -> None:
    rng = np.random.default_rng(2)
    logs = {name: log_of(log_arrays(rng)) for name in ("v1", "v2")}
    channels = channels_of(logs, dict.fromkeys(logs, SignalNames(STATES)), {})
    assert {channel.path for channel in channels} == {
        (vehicle, *rest)
        for vehicle in logs
        for rest in (("truth",), ("input",), ("readings", "ranges"), ("estimate",), ("plan",), ("cramer_rao",))
    }
    for name, log in logs.items():
        found = made_again([channel for channel in channels if channel.vehicle == name], log.t)
        np.testing.assert_array_equal(found["truth.x"], log.x)


def test_a_sensor_that_was_never_read_and_a_bound_of_no_columns_leave_no_rows() -> None:
    arrays = log_arrays(np.random.default_rng(3))
    arrays["measurement.ranges"][:] = np.nan
    arrays["cramer_rao.deviation"] = np.empty((5, 0))
    channels = channels_of({"robot": log_of(arrays)}, {"robot": SignalNames(STATES)}, {})
    read = {channel.name: channel for channel in channels}
    assert len(read["readings/ranges"].t) == 0
    assert "cramer_rao" not in read
