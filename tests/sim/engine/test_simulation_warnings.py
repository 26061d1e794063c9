"""MuJoCo's warnings are events of the plant; the one that loses the state ends the run, whatever flies."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.interfaces.signals import DIVERGED
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup

TWO = """<mujoco><worldbody><geom type="plane" size="9 9 1"/>
<body pos="0 0 5"><joint name="one/slide" type="slide" axis="1 0 0"/><geom size=".1"/></body>
<body pos="1 0 5"><joint name="two/ball" type="ball"/><geom size=".1"/>
<body pos="0 0 -.3"><joint name="two/elbow" axis="0 1 0" stiffness="{stiffness}"/><geom size=".1"/></body></body>
</worldbody><actuator><motor name="one/motor" joint="one/slide"/></actuator></mujoco>"""


def plant(stiffness: float = 0.0) -> MujocoPlant:
    model = mujoco.MjModel.from_xml_string(TWO.format(stiffness=stiffness))
    elbow = np.array([1.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    vehicles = {"one": VehicleSetup(np.zeros(2)), "two": VehicleSetup(elbow)}
    return MujocoPlant(model, vehicles, np.random.default_rng(0))


@pytest.mark.parametrize("ticks", [1, 4, 50])
def test_a_divergence_is_an_event_at_its_tick_with_its_joint(ticks: int) -> None:
    simulated, alone = plant(stiffness=1e9), plant(stiffness=1e9)
    while not alone.data.warning.number.any():
        mujoco.mj_step(alone.model, alone.data)
    events = []
    while len(events) == 0:
        events = list(simulated.step({}, ticks))
    (event,) = events
    assert (event.agent, event.kind, event.t) == ("two", DIVERGED, pytest.approx(alone.data.time))
    lost = "an acceleration that is not finite, or beyond 1e10"
    assert event.message == f"the simulation diverged in the joint 'two/elbow': {lost}"
    assert simulated.t % (ticks * simulated.dt) == pytest.approx(0.0, abs=1e-12)
    assert list(simulated.step({}, ticks)) == []  # said once


def test_a_state_that_is_put_beyond_every_bound_is_named() -> None:
    simulated = plant()
    simulated.data.qpos[5] = 1e11
    (event,) = simulated.step({})
    assert "in the joint 'two/elbow': a position that" in event.message
    simulated = plant()
    simulated.data.qvel[3] = np.inf
    (event,) = simulated.step({}, 3)
    assert "in the joint 'two/ball': a velocity that" in event.message


def test_what_mujoco_leaves_out_is_an_event_once() -> None:
    simulated = plant()
    (event,) = simulated.step({"one": np.array([1e11])}, 5)
    assert (event.t, event.kind) == (simulated.dt, "physics-warning")
    assert event.message.startswith("Nan, Inf or huge value in CTRL at ACTUATOR 0")
    assert list(simulated.step({"one": np.array([1e11])}, 5)) == []


@pytest.mark.parametrize("scenario", ["missile-guidance", "simultaneous-arrival"])
def test_a_run_ends_where_its_simulation_diverges(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of an actuator that went wild after 0.1 s."""
    step, taken = mujoco.mj_step, [0.0]

    def wild(model: Any, data: Any, nstep: int = 1) -> None:
        taken[0] += nstep * model.opt.timestep
        if taken[0] > 0.1:
            data.qvel[-1] = 1e11
        step(model, data, nstep)

    monkeypatch.setattr(mujoco, "mj_step", wild)
    outcome = mn.run(scenario)
    (event,) = [each for each in outcome.events if each.kind == DIVERGED]
    assert not outcome.success
    assert outcome.summary["shortfall"] == f"at {event.t:.6g} s {event.message}"
    assert outcome.t[-2] < event.t <= outcome.t[-1] < 1.0
