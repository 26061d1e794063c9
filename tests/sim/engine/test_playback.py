"""A finished run as a plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Estimate, PlanRequest
from mathnavi.models.textbook.mission import OutputSensor
from mathnavi.sim.engine.playback import RecordedInputs, RecordedPlant, RecordedRun

DT = 0.01
ROWS = np.array([0, 3, 6, 9, 10])  # [ticks] the last step is shorter
NAN = np.nan
RUN = RecordedRun(
    ROWS * DT,
    np.arange(10.0).reshape(5, 2),
    np.array([[1.0], [2.0], [3.0], [4.0], [5.0]]),
    {"output": np.array([[0.5], [NAN], [0.7], [0.8], [NAN]]), "other": np.zeros((5, 3))},
    SignalNames(("x_1 [-]", "x_2 [-]")),
)


def plant(rate: float | None = None, run: RecordedRun = RUN) -> RecordedPlant:
    return RecordedPlant("v", run, DT, (OutputSensor(1, rate),))


def test_it_is_a_plant_that_shows_what_was() -> None:
    recorded = plant()
    assert isinstance(recorded, Plant)
    assert recorded.names == ("v",)
    assert recorded.sensor_sizes("v") == {"output": 1}
    for k, ticks in enumerate((3, 3, 3, 1)):
        assert recorded.t == RUN.t[k]
        np.testing.assert_array_equal(recorded.state("v"), RUN.x[k])
        assert not recorded.step({"v": np.full(1, 99.0)}, ticks)
    assert recorded.t == RUN.t[4]


def test_readings_are_stamped_with_the_time_at_which_they_fell_due() -> None:
    """Every fifth tick: at 0, 5 and 10. The log shows them at the samples at 0, 6 and 10 ticks."""
    recorded = plant(20.0, replace(RUN, readings={"output": np.array([[0.5], [NAN], [0.7], [NAN], [0.9]])}))
    read = []
    for ticks in (3, 3, 3, 1, 0):
        read += [(reading.t, float(reading.value[0])) for reading in recorded.sense("v")]
        if ticks:
            recorded.step({}, ticks)
    assert read == [(0.0, 0.5), (5 * DT, 0.7), (10 * DT, 0.9)]


def test_a_lost_reading_stays_lost() -> None:
    recorded = plant()
    seen = []
    for ticks in (3, 3, 3, 1, 0):
        seen.append(len(recorded.sense("v")))
        if ticks:
            recorded.step({}, ticks)
    assert seen == [1, 0, 1, 1, 0]


def test_inputs_are_given_again() -> None:
    inputs = RecordedInputs(RUN, 0.03)
    estimate = Estimate(0.0, np.zeros(2))
    plan = inputs.plan(PlanRequest(0.0, 0.0, estimate, None))
    assert plan.ok
    assert [float(inputs.command(t, estimate, plan)[0]) for t in RUN.t] == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"it reads output \(2\), and the run measured output \(1\), other \(3\)"):
        RecordedPlant("v", RUN, DT, (OutputSensor(2, None),))
    with pytest.raises(ValueError, match=r"it reads output every 0\.02 s"):
        plant(50.0)  # every second tick, while the run was logged at every third
    with pytest.raises(ValueError, match=r"between physics ticks; allowed: at multiples of 0\.02 s"):
        RecordedPlant("v", RUN, 2.0 * DT, (OutputSensor(1, None),))
    with pytest.raises(ValueError, match="the next sample is 3 ticks ahead"):
        plant().step({}, 2)
    for act in (plant().apply_wrench, plant().displace, plant().place):
        with pytest.raises(ValueError, match="what is over cannot be"):
            act("v", np.zeros(2))
