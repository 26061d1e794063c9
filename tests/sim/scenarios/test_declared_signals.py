"""What a scenario and an estimator declare of their signals is in the log, and what does not fit is said by name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Estimate
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.scenarios.declared_signals import check_declared, name_signals, true_values
from mathnavi.sim.scenarios.task import Inputs, Task

T = np.array([0.0, 0.1, 0.2])
TRUTH = np.arange(9.0).reshape(3, 3)
TASK = Task({"rover": Inputs.within(("left [rad/s]", "right [rad/s]"))}, lambda begin, end, commands: 0.0)


def recording() -> Recording:
    agent = AgentRecorder("rover", [], np.zeros((3, 2)), {})
    for t, x in zip(T, TRUTH, strict=True):
        agent.estimate(Estimate(float(t), x[:2]))
    names = SignalNames(("a", "b", "c"), ("of the model", "likewise"))
    return Recording(
        T, {"rover": TRUTH}, {"rover": agent}, agent.events, {"rover": names.states}, 3, signals={"rover": names}
    )


def agents(**declared: Any) -> Any:
    return {"rover": SimpleNamespace(estimator=SimpleNamespace(**declared), input_size=2)}


def test_the_names_of_task_estimator_and_estimands_are_in_the_recording() -> None:
    made = recording()
    name_signals(made, agents(numbers=("east [m]", "north [m]")), TASK, lambda truth: {"east [m]": truth[:, 1]})
    names = made.signals["rover"]
    assert names.inputs == ("left [rad/s]", "right [rad/s]")
    assert (names.estimates, names.estimands) == (("east [m]", "north [m]"), ("east [m]",))
    np.testing.assert_array_equal(made.arrays()["truth.estimands"], TRUTH[:, [1]])
    assert made.events == []


def test_without_declarations_the_names_of_the_model_stay() -> None:
    made = recording()
    name_signals(made, agents(), None, None)
    assert made.signals["rover"] == recording().signals["rover"]
    assert "truth.estimands" not in made.arrays()


def test_names_of_another_number_of_estimates_are_an_event_and_not_used() -> None:
    made = recording()
    name_signals(made, agents(numbers=("east [m]",)), TASK, None)
    assert made.signals["rover"].estimates == ()
    (event,) = made.events
    assert (event.kind, event.message) == ("estimate-names", "the estimator names 1 number; an estimate has 2")


@pytest.mark.parametrize("numbers", ["east", (1, 2)])
def test_numbers_that_are_no_names_are_refused_before_the_run(numbers: Any) -> None:
    with pytest.raises(ArgumentError, match=r"rover: the estimator has numbers = .*; allowed: a name for each number"):
        check_declared(SimpleNamespace(), agents(numbers=numbers), None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ([1.0], r"estimands = \[1\.0\]; allowed: arrays \(n,\) by name"),
        ({}, r"allowed: arrays \(n,\) by name"),
        ({"east [m]": TRUTH}, r"estimands\['east \[m\]'\] has shape \(3, 3\); allowed: \(3,\)"),
    ],
)
def test_what_is_no_estimand_is_refused(found: Any, said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        true_values(lambda truth: found, TRUTH)
