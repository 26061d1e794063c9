"""The environments of dm_env: its own checker, the run of the same seed, what ends an episode, bad input."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import dm_env
import numpy as np
import pytest
from dm_env import specs

from mathnavi.controllers.flight import plugin as flight_plugin
from mathnavi.interfaces.fields import with_fields
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.environments.dm import load
from mathnavi.sim.plugin.registry import load as plugin
from tests.sim.environments import missions

STILL = np.zeros(3)


@pytest.mark.honoured("environment", "dm_env: environment, specs, time steps")
@pytest.mark.parametrize("scenario", missions.SCENARIOS)
def test_every_scenario_passes_the_checker_of_dm_env(scenario: str) -> None:
    missions.assert_passes_dm_env(lambda: missions.environment(scenario))


@pytest.mark.parametrize("scenario", ["safe-flight", "simultaneous-arrival", "quadrotor-canyon", "missile-guidance"])
def test_the_commands_of_a_run_lead_to_the_estimates_of_the_run(scenario: str) -> None:
    """A run of the same fields and seed, its mission given, has the same noise."""
    environment = missions.environment(scenario)
    seen = [environment.reset()]
    config = with_fields(plugin("scenarios", scenario).Config(), missions.fields(scenario))
    own = plugin("scenarios", scenario).build(config, 1).task.mission  # drawn from the environment's seed
    closed_loop = plugin("scenarios", scenario).build(dataclasses.replace(config, **own), environment.episode_seed)
    duration = 30 * missions.commanded(scenario).period
    run = simulate(closed_loop.plant, closed_loop.agents, duration, network=closed_loop.network)
    names = list(closed_loop.agents)
    for k in range(30):
        commands = [run.agents[name].commands[k] for name in names]
        seen.append(environment.step(np.array(commands) if len(names) > 1 else commands[0]))
    for k, step in enumerate(seen):
        estimates = [run.agents[name].estimates[k].x for name in names]
        np.testing.assert_array_equal(step.observation["x"], estimates if len(names) > 1 else estimates[0])
        np.testing.assert_array_equal(step.observation["t"], run.agents[names[0]].estimates[k].t)
    logged = environment.recording
    assert all(np.array_equal(logged.truths[name], run.truths[name]) for name in names)


@pytest.mark.honoured("environment", "seed of episodes")
def test_a_seed_tells_all_episodes_and_each_differs_from_the_last() -> None:
    def played(seed: int) -> list[np.ndarray[Any, Any]]:
        environment = missions.environment("safe-flight", seed)
        return [environment.reset().observation["x"] for _ in range(2)]

    one, same, other = played(1), played(1), played(2)
    assert np.array_equal(one, same)
    assert not np.array_equal(one[0], one[1])
    assert not np.array_equal(one[0], other[0])


def test_the_mission_stays_and_a_reset_builds_no_cost_to_go(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ends of the fleet are drawn; those of every episode are the same."""
    environment = missions.environment("simultaneous-arrival")
    environment.reset()

    def built(*_: Any) -> None:
        raise AssertionError("a cost-to-go is built")

    monkeypatch.setattr(flight_plugin, "_built", built)
    before = environment.recording.truths
    environment.reset()
    assert all(np.array_equal(x[0], environment.recording.truths[name][0]) for name, x in before.items())


@pytest.mark.honoured("environment", "termination")
def test_contact_ends_an_episode_and_the_next_step_begins_another() -> None:
    environment = missions.environment("safe-flight")
    step = environment.reset()
    down = np.array([0.0, 0.0, -40.0])
    while not step.last():
        step = environment.step(down)
        assert step.discount == (0.0 if step.last() else 1.0)
    kinds = [event.kind for event in environment.recording.events]
    assert kinds == ["ground-contact"]
    assert environment.recording.length == len(environment.recording.t)
    before = environment.episode_seed
    assert environment.step(down).first()
    assert environment.episode_seed != before


@pytest.mark.honoured("environment", "truncation")
def test_time_that_is_up_is_a_truncation_and_the_cost_is_the_rms_that_the_run_is_judged_by() -> None:
    environment = missions.environment("arm-velocity")
    step, cost = environment.reset(), 0.0
    while not step.last():
        step = environment.step(np.array([0.5, -0.5]))
        cost -= 0.0 if step.reward is None else step.reward
    assert step.step_type is dm_env.StepType.LAST
    assert step.discount == 1.0
    recording = environment.recording
    assert recording.t[-1] == pytest.approx(0.05)
    estimates = np.array([estimate.x for estimate in recording.agents["mechanism"].estimates])[1:]
    errors = (estimates - recording.truths["mechanism"][1:])[:, 2:]
    assert cost > 0.0
    assert cost / 0.05 == pytest.approx(float(np.square(errors).sum(axis=1).mean()), rel=0.02)


@pytest.mark.honoured("environment", "finite rewards")
def test_a_state_that_the_physics_loses_ends_an_episode_and_every_reward_is_finite(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes down its warnings
    environment = missions.environment("arm-velocity")
    step = environment.reset()
    while not step.last():
        step = environment.step(np.array([9e9, -1e9]))
        assert np.isfinite(step.reward)
    assert step.discount == 0.0


def test_the_reward_of_a_flight_is_its_effort_and_its_time() -> None:
    environment = missions.environment("safe-flight")
    environment.reset()
    h = missions.commanded("safe-flight").period
    assert environment.step(STILL).reward == pytest.approx(-100.0 * h)
    assert environment.step(np.array([3.0, 4.0, 0.0])).reward == pytest.approx(-125.0 * h)
    assert environment.step(np.array([0.0, 400.0, 0.0])).reward == pytest.approx(-1700.0 * h)  # shortened to a_max
    assert [event.kind for event in environment.recording.events] == ["input-clipped"]


@pytest.mark.honoured("environment", "spaces with bounds and units")
def test_specs_tell_units_and_the_scenarios_own_bounds() -> None:
    quadrotor = missions.environment("quadrotor-canyon").action_spec()
    assert isinstance(quadrotor, specs.BoundedArray)
    assert quadrotor.name.startswith("thrust_front_left [N], ")
    assert (quadrotor.minimum == 0.0).all()
    assert missions.environment("simultaneous-arrival").action_spec().shape == (2, 3)
    body = missions.environment("sphere-observer").action_spec()
    assert not isinstance(body, specs.BoundedArray)
    assert body.name == "torque_x [N m], torque_y [N m], torque_z [N m]"
    assert set(missions.environment("quadrotor-canyon").observation_spec()) == {
        "t", "x", "status", "covariance", "attitude", "rate"
    }  # fmt: skip
    assert "covariance" not in missions.environment("sphere-observer").observation_spec()


def test_another_estimator_is_observed_by_its_name() -> None:
    seen = load("textbook-observer", seed=2, estimator="output_injection", system="krener-isidori").reset().observation
    assert set(seen) == {"t", "x", "status", "covariance"}
    assert seen["x"].shape == (2,)
    assert seen["covariance"].shape == (2, 2)


@pytest.mark.refused("environment", "fields that are unknown or not allowed")
@pytest.mark.parametrize(
    ("scenario", "fields", "expected"),
    [
        ("safe-fight", {}, "scenarios: 'safe-fight' is not known; "),
        ("safe-flight", {"speed": 3.0}, "speed is not a field; "),
        ("safe-flight", {"gust_rms": 0.5}, "gust_rms is not a field; did you mean faults.gust_rms"),
        ("safe-flight", {"speed_max": -3.0}, "speed_max = -3.0; allowed: "),
        ("safe-flight", {"noise": {"position": "much"}}, "noise.position = 'much'; allowed: float"),
        ("safe-flight", {"seed": -1}, "seed = -1; allowed: a whole number from 0 to"),
        ("safe-flight", {"estimator": "none"}, "estimators: 'none' is not known; allowed: "),
        ("textbook-observer", {"system": "kazantzis-kravaris"}, "has no actuators, so there is nothing to command"),
    ],
)
def test_what_cannot_be_an_environment_is_refused(scenario: str, fields: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match="allowed") as refusal:
        load(scenario, **fields)
    assert expected in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.refused("environment", "actions of another shape, or not finite")
@pytest.mark.parametrize(
    ("action", "expected"),
    [
        (np.zeros(2), "action has shape (2,); allowed: (3,), of acceleration_x [m/s^2], "),
        (np.array([0.0, np.nan, 0.0]), "action = [0.0, nan, 0.0]; allowed: finite numbers"),
        (np.array([0.0, 1e200, 0.0]), "action = [0.0, 1e+200, 0.0]; allowed: finite numbers, whose squares are"),
    ],
)
def test_an_action_that_is_none_is_refused(action: Any, expected: str) -> None:
    environment = missions.environment("safe-flight")
    environment.reset()
    with pytest.raises(ValueError, match="allowed") as refusal:
        environment.step(action)
    assert expected in str(refusal.value)
