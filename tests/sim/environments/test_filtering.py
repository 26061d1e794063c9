"""Filtered commands: the checkers of Gymnasium and dm_env, and no contact under a policy that dives."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv

from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.environments.dm import FilteredEnvironment
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.environments.filtering import EpisodeFilter
from mathnavi.sim.environments.gym import SafetyFilterWrapper, ScenarioEnv
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.studies.flight import hostile_parts, policy_flight
from tests.sim.environments import missions

FILTERED = ("safe-flight", "simultaneous-arrival", "quadrotor-canyon")


@pytest.fixture
def built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mathnavi.sim.environments.gym.EpisodeRunner", lambda spec: missions.commanded(spec.scenario))


@pytest.mark.parametrize("scenario", FILTERED)
def test_it_passes_both_checkers(scenario: str, built_once: None) -> None:
    missions.assert_passes_dm_env(lambda: FilteredEnvironment(missions.environment(scenario)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # advice on wrappers and spaces
        check_env(SafetyFilterWrapper(ScenarioEnv(scenario)))


def test_a_diving_policy_touches_nothing_and_info_says_what_was_flown(built_once: None) -> None:
    terrain = load_terrain(missions.hills())
    env = SafetyFilterWrapper(ScenarioEnv("safe-flight"))
    env.reset(seed=1)
    infos = []
    for _ in range(900):
        _, _, terminated, truncated, info = env.step(np.array([4.0, 2.0, -20.0]))
        assert not terminated
        assert not truncated
        infos.append(info["filter"])
    path = env.unwrapped.episode.recording.truths["vehicle"]
    clearance = path[:, 2] - terrain.height(path[:, 0], path[:, 1])
    assert 50.0 <= clearance.min() < 100.0
    assert {info["flown"] for info in infos} >= {"proposed", "nearest"}
    assert infos[-1]["interventions"] == sum(info["intervened"] for info in infos)
    assert all(info["guaranteed"] and not info["announced"] and info["margin"] >= 0.0 for info in infos)


def test_each_vehicle_of_a_fleet_has_its_own_and_info_says_what_is_guarded() -> None:
    environment = FilteredEnvironment(missions.environment("simultaneous-arrival"))
    environment.reset()
    environment.step(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 90.0]]))
    first, second = environment.info.values()
    assert not first["intervened"]
    assert second["intervened"]
    assert first["guarded"] == ("ground", "map")


def test_a_quadrotor_is_proposed_accelerations_and_stays_near_the_plan_behind_them() -> None:
    environment = FilteredEnvironment(missions.environment("quadrotor-canyon"))
    environment.reset()
    assert environment.action_spec().shape == (3,)
    rng, infos = np.random.default_rng(0), []
    for push in np.repeat(rng.normal(size=(10, 3)), 4, axis=0):
        step = environment.step(2.0 * push - [0.0, 0.0, 1.0])
        assert not step.last()
        infos.append(environment.info)
    assert any(info["intervened"] for info in infos)
    assert not any(info["breach"] or info["announced"] for info in infos)
    assert not any(event.kind == "contact" for event in environment.environment.recording.events)


def test_a_scenario_without_a_filter_and_a_strange_environment_are_refused(built_once: None) -> None:
    with pytest.raises(ValueError, match="'sphere-observer' defines no safety filter; allowed: safe-flight"):
        SafetyFilterWrapper(ScenarioEnv("sphere-observer"))
    with pytest.raises(ValueError, match="'sphere-observer' defines no safety filter"):
        FilteredEnvironment(missions.environment("sphere-observer"))


FIELDS = {
    "safe-flight": {"terrain": "canyon:3", "clearance_min": 20.0, "speed_max": 60.0},
    "quadrotor-canyon": missions.fields("quadrotor-canyon"),
}
STRANGERS = {
    "safe-flight": f"{hostile_parts.__name__}:HostileFullState",
    "quadrotor-canyon": f"{hostile_parts.__name__}:HostileQuadrotorState",
}
MISDEEDS = {
    # Without the outputs that its estimate does not have; and of a quadrotor, those that are its own.
    "safe-flight": [each for each in hostile_parts.MISDEEDS["estimator.misdeed"] if each not in ("bare", "blank")],
    "quadrotor-canyon": ["raises", "bare", "blank", "far"],
}
HARMLESS = {"none", "lists", "covariance-lists", "half", "moves-command", "keeps"}  # the boundary mends them


def strange(scenario: str) -> SafetyFilterWrapper:
    return SafetyFilterWrapper(ScenarioEnv(scenario, 1, STRANGERS[scenario], **FIELDS[scenario]))


def told(env: SafetyFilterWrapper, misdeed: str) -> None:
    """Have the estimator of the present episode commit this misdeed at every step."""
    estimator: Any = env.unwrapped.episode._loop.runners["vehicle"].agent.estimator
    always = hostile_parts.Instants(1.0, 1, np.random.default_rng(0))
    estimator._misdeeds._misdeed, estimator._misdeeds._instants = misdeed, always


@pytest.mark.refused("plug-in", "estimator in an episode: an answer that cannot be used")
@pytest.mark.parametrize("scenario", sorted(STRANGERS))
def test_whatever_an_estimator_answers_in_an_episode_the_episode_goes_on_and_info_says_what_is_guaranteed(
    scenario: str,
) -> None:
    env, rng = strange(scenario), np.random.default_rng(3)
    steps = 1 if scenario == "quadrotor-canyon" else 2  # of a quadrotor many estimates
    env.reset(seed=1)

    def flown(misdeed: str) -> tuple[bool, str]:
        told(env, misdeed)
        for _ in range(steps):
            observation, _, terminated, truncated, info = env.step(rng.normal(size=3))
            assert env.observation_space.contains(observation), misdeed
            if terminated or truncated:  # a wrong estimate may lead into the ground
                env.reset(seed=1)
        return info["filter"]["guaranteed"], info["filter"]["announced"]

    for misdeed in MISDEEDS[scenario]:
        guaranteed, announced = flown(misdeed)
        assert (guaranteed, bool(announced)) == (misdeed in HARMLESS, misdeed not in HARMLESS), (misdeed, announced)
        flown("none")


def test_an_estimator_that_misbehaves_in_one_lane_changes_nothing_in_another() -> None:
    alone, lanes = strange("safe-flight"), SyncVectorEnv([lambda: strange("safe-flight")] * 2)
    action = np.array([3.0, 0.0, -4.0])
    alone.reset(seed=5)
    lanes.reset(seed=[4, 5])
    told(lanes.envs[0], "covariance-nine")  # type: ignore[arg-type]
    for k in range(6):
        if k == 3:
            told(lanes.envs[0], "raises")  # type: ignore[arg-type]
        observation, *_, info = alone.step(action)
        observations, *_, infos = lanes.step(np.array([action, action]))
        assert {name: value[1].tolist() for name, value in observations.items()} == {
            name: np.asarray(value).tolist() for name, value in observation.items()
        }
        assert infos["filter"]["guaranteed"].tolist() == [k == 0, info["filter"]["guaranteed"]]


def test_an_episode_is_a_run_behind_the_filter_bit_for_bit_for_the_same_actions() -> None:
    """So a search flies runs in place of episodes: policy and estimator are those of strangers."""
    fields = {
        "terrain": "canyon:3", "start": (180.0, 300.0, 1560.0), "target": (460.0, 300.0, 1560.0), "clearance_min": 10.0,
        "speed_max": 40.0, "noise.position": 1.0, "faults.gust_rms": 0.5,
        "estimator.misdeed": "raises", "estimator.share": 0.2,
    }  # fmt: skip
    acting = {"planner.policy": "dive", "planner.hold": 3, "filter": True}
    policy = f"{policy_flight.__name__}:PolicyFlight"
    spec = RunSpec.of("safe-flight", 5, policy, STRANGERS["safe-flight"], {**fields, **acting})
    run = dataclasses.replace(spec.build(), duration=4.0).run()
    runner = EpisodeRunner(RunSpec.of("safe-flight", 5, None, STRANGERS["safe-flight"], fields))
    runner.begin(5)
    actions = policy_flight.PolicyTracker(spec.controller.config, runner.terms.missions["vehicle"])
    command_filter = EpisodeFilter(runner)
    guaranteed = []
    for _ in range(240):
        proposed = actions.command(runner.t, runner.estimates["vehicle"], None)
        runner.step(command_filter.filtered(proposed))
        guaranteed.append(command_filter.decided()["guaranteed"])
    episode = runner.recording.arrays()
    assert {*guaranteed} == {True, False}
    for name in ("truth.x", "command.u", "estimate.x"):
        assert run.arrays[name][:240].tobytes() == episode[name][:240].tobytes(), name
