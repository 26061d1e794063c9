"""Filtered commands: the checkers of Gymnasium and dm_env, and no contact under a policy that dives."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.environments.dm import FilteredEnvironment
from mathnavi.sim.environments.gym import SafetyFilterWrapper, ScenarioEnv
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
