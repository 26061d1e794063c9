"""Environments to learn in: the checkers, the order of returns, shaping, what is observed, bad input."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from dm_env import specs

from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.dynamics import NOMINAL
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.environments.dm import FilteredEnvironment, LearningEnvironment
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.environments.gym import LearningEnv, SafetyFilterWrapper
from mathnavi.sim.environments.learning import LearningEpisode
from mathnavi.sim.environments.registration import identifier
from mathnavi.sim.plugin.registry import load as plugin
from mathnavi.sim.records.run_spec import RunSpec
from tests.sim.environments import missions

Policy = Callable[[dict[str, Any]], Array]


def learning(scenario: str, **options: Any) -> LearningEpisode:
    return LearningEpisode(missions.commanded(scenario), **options)


@pytest.mark.parametrize("scenario", missions.SCENARIOS)
def test_every_scenario_passes_both_checkers_and_its_actions_are_bounded(
    scenario: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def made() -> LearningEnvironment:
        return LearningEnvironment(learning(scenario), np.random.default_rng(1))

    missions.assert_passes_dm_env(made)
    action = made().action_spec()
    assert isinstance(action, specs.BoundedArray)
    assert np.isfinite([action.minimum, action.maximum]).all()
    missions.assert_passes_gymnasium(identifier(scenario, 1), monkeypatch)


def played(episode: LearningEpisode, policy: Policy, seed: int = 1) -> tuple[list[float], dict[str, Any], float]:
    """Rewards, the last info and the time of the end [s]."""
    observation, _ = episode.begin(seed)
    rewards = []
    while True:
        made = episode.step(policy(observation))
        observation = made.observation
        rewards.append(made.reward)
        if made.last:
            return rewards, made.info, episode.runner.t


@cache
def near(scenario: str) -> EpisodeRunner:
    """A mission whose target is not far."""
    return EpisodeRunner(RunSpec.of(scenario, 1, fields=missions.fields(scenario)))


def by_the_controller(scenario: str) -> tuple[float, Array]:
    """Time of arrival [s] and the tracker's commands (n, nu) of the shipped controller, a row a period."""
    closed_loop = plugin("scenarios", scenario).build(near(scenario).config, 1)
    run = simulate(closed_loop.plant, closed_loop.agents, closed_loop.duration, closed_loop.finished)
    return float(run.t[-1]), run.agents["vehicle"].commands


SCRIPTED = {
    "safe-flight": (np.zeros(3), np.array([0.0, 0.0, -40.0])),
    "quadrotor-canyon": (np.full(4, NOMINAL.hover_thrust), np.zeros(4)),
}


@pytest.mark.parametrize("scenario", SCRIPTED)
def test_arriving_is_best_being_late_is_worse_and_a_crash_is_worst_however_soon_it_comes(scenario: str) -> None:
    hover, dive = SCRIPTED[scenario]
    arrives_at, commands = by_the_controller(scenario)
    episode = LearningEpisode(near(scenario), hold=near(scenario).period)
    tracked = iter(commands)
    arriving, end, t = played(episode, lambda _: next(tracked))
    assert (end["outcome"], t) == ("arrived", pytest.approx(arrives_at))
    held = LearningEpisode(near(scenario), hold=None if scenario == "safe-flight" else 0.1)
    late, end, t_late = played(held, lambda _: hover)
    assert end["outcome"] == "late"
    crash, end, t_crash = played(held, lambda _: dive)
    assert end["outcome"] == "crashed"
    assert end["events"][-1] == "ground-contact"
    assert t_crash < t < t_late == pytest.approx(held.runner.terms.deadline, abs=held.hold)
    assert -2.0 < sum(crash) <= -1.0 < sum(late) < 0.0 < sum(arriving) < 1.0


def test_the_potential_adds_up_to_one_and_leaves_the_order_of_discounted_returns() -> None:
    """sum gamma^k (r_k with Psi) = sum gamma^k (r_k without) + Psi(x_0) / Psi(x_0), for any gamma and any policy."""
    gamma, push = 0.9, np.array([8.0, 0.0, -4.0])
    shaped, _, _ = played(learning("safe-flight", discount=gamma), lambda _: push)
    episode = learning("safe-flight", discount=gamma)
    terms, h = episode.runner.terms, episode.hold
    steps = len(shaped)
    plain = np.full(steps, -(float(push @ push) + 100.0) * h / (terms.cost_max * terms.deadline))
    discounts = gamma ** np.arange(steps)
    lost = float(discounts @ plain) - 2.0 * discounts[-1] + 1.0
    assert float(discounts @ shaped) == pytest.approx(lost, abs=0.01)  # the last step is shorter, and below h_min


def test_a_flight_below_h_min_costs_as_much_as_any_second_can() -> None:
    episode = learning("safe-flight", hold=0.1)
    terms = episode.runner.terms
    down, h = np.array([0.0, 0.0, -10.0]), episode.hold
    episode.begin(1)
    rewards, clearances, left = [], [], [1.0]
    while not rewards or clearances[-1] > 40.0:
        made = episode.step(down)
        rewards.append(made.reward)
        clearances.append(made.info["clearance"])
        left.append(terms.potential(episode.runner.t, episode.runner.truths))
    costs = (np.diff(left) * -1.0 - rewards) * terms.cost_max * terms.deadline / h  # [m^2/s^4] a second
    assert costs[0] == pytest.approx(200.0)
    assert costs[-1] == pytest.approx(1700.0)
    assert clearances[-1] < 50.0 < clearances[0]


def test_what_is_observed_is_where_the_target_is_and_the_ground_ahead() -> None:
    episode = learning("safe-flight")
    seen, info = episode.begin(1)
    mission, ground = episode.runner.mission, episode.runner.terms.ground
    start, target = np.array(mission["start"]), np.array(mission["target"])
    np.testing.assert_allclose(seen["target"], target - start, atol=10.0)  # noise of 2 m
    assert info["clearance"] == pytest.approx(start[2] - float(ground.height(*start[:2])))
    p = target - seen["target"]
    assert seen["horizon"][0, 0] == pytest.approx(float(ground.height(p[0] + 600.0, p[1])) - p[2], abs=5.0)  # due east
    assert seen["horizon"][2, 1] == pytest.approx(float(ground.height(p[0], p[1] + 1500.0)) - p[2], abs=20.0)  # north
    for _ in range(20):
        seen = episode.step(np.array([5.0, 5.0, 1.0])).observation
    p, v = target - seen["target"], seen["velocity"]
    assert seen["clearance_ahead"][1] == pytest.approx(p[2] + 2.0 * v[2] - float(ground.height(*(p + 2.0 * v)[:2])))
    slope = ground.gradient(*(p + 4.0 * v)[:2]) @ (v[:2] / np.hypot(*v[:2]))
    assert seen["slope_ahead"][2] == pytest.approx(float(slope))
    assert "covariance" not in seen
    assert learning("safe-flight", covariance=True).begin(1)[0]["covariance"].shape == (6, 6)


def test_leaving_the_map_and_a_lost_state_are_crashes() -> None:
    rewards, end, _ = played(learning("safe-flight"), lambda _: np.array([-40.0, 0.0, 10.0]))
    assert end["outcome"] == "off the map"
    assert sum(rewards) < -1.0


def test_an_episode_that_is_over_and_wrong_terms_are_refused(built: EpisodeRunner) -> None:
    episode = LearningEpisode(built)
    played(episode, lambda _: np.zeros(3))
    with pytest.raises(ValueError, match="the episode is over; allowed: after reset"):
        episode.step(np.zeros(3))
    for options, expected in (
        ({"hold": 0.0137}, "hold = 0.0137 s is not a whole number"),
        ({"discount": 1.5}, "discount = 1.5; allowed: > 0 and <= 1"),
        ({"covariance": True}, "covariance = True; allowed: False"),
    ):
        with pytest.raises(ValueError, match=r"allowed|whole") as refusal:
            LearningEpisode(built, **options)
        assert expected in str(refusal.value)


def test_the_filter_is_of_version_0(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="allowed: one that load"):
        FilteredEnvironment(LearningEnvironment(learning("safe-flight"), np.random.default_rng(0)))
    monkeypatch.setattr("mathnavi.sim.environments.gym.EpisodeRunner", lambda *_: missions.commanded("safe-flight"))
    with pytest.raises(ValueError, match="a LearningEnv; allowed: a ScenarioEnv, version 0"):
        SafetyFilterWrapper(LearningEnv("safe-flight"))


@pytest.fixture
def built() -> EpisodeRunner:
    """A point on the sphere for a few steps, of an estimator without a covariance."""
    return EpisodeRunner(RunSpec.of("sphere-observer", 1, fields={"duration": 0.05, "settled": 0.0}))
