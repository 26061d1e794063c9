"""Flights for a learner: features of order 1 with the target ahead, and a velocity that is flown."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import mathnavi.sim.environments  # noqa: F401  makes them known to Gymnasium
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.learning.boxes import BoxObservations, BoxVectorObservations
from mathnavi.learning.clean_rl import CleanRlEnv
from mathnavi.learning.flights import VelocityFlight, VelocityFlights
from mathnavi.learning.velocity import FEATURES, VelocityControl, features, turned
from tests.sim.environments import missions

ROWS = 3
FIELDS: dict[str, Any] = {
    "seed": 5, "terrain": missions.hills(), "target": (7000.0, 3000.0, 800.0), "drawn_separation": (0.2, 0.6)
}  # fmt: skip


def many(**options: Any) -> gymnasium.vector.VectorEnv[Any, Any, Any]:
    """Three missions at once."""
    return gymnasium.make_vec("mathnavi/SafeFlight-v1", num_envs=ROWS, **FIELDS, **options)


def single(**options: Any) -> gymnasium.Env[Any, Any]:
    """The first of them alone."""
    return gymnasium.make("mathnavi/SafeFlight-v1", **FIELDS, **options)


def test_the_frame_has_the_target_ahead_and_the_way_back_is_exact() -> None:
    rng = np.random.default_rng(0)
    target, vectors = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    own = turned(target, target, ahead=True)
    np.testing.assert_allclose(own[:, 0], np.hypot(target[:, 0], target[:, 1]))
    np.testing.assert_allclose(own[:, 1], 0.0, atol=1e-15)
    np.testing.assert_allclose(turned(turned(vectors, target, ahead=True), target, ahead=False), vectors, atol=1e-15)


def test_features_do_not_depend_on_where_east_is_and_are_of_order_1() -> None:
    observations, _ = many().reset(seed=0)
    found = features(observations)
    assert (found.shape, found.dtype) == ((ROWS, FEATURES), np.float32)
    assert 0.1 < np.abs(found).max() < 10.0
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    elsewhere = observations | {name: observations[name] @ turn.T for name in ("velocity", "target")}
    np.testing.assert_allclose(features(elsewhere), found, atol=1e-6)


def test_an_action_is_a_velocity_which_the_vehicle_takes() -> None:
    env = VelocityFlight(single())
    env.reset(seed=0)
    control, wanted = VelocityControl(), np.array([[60.0, -20.0, 10.0]])
    for _ in range(20):
        observation, *_ = env.step(control.actions(wanted, env._last)[0])
    assert observation in env.observation_space
    np.testing.assert_allclose(env._last["velocity"], wanted, atol=0.5)


def test_actions_are_clipped_to_the_fastest() -> None:
    observations, _ = many().reset(seed=0)
    control = VelocityControl(ahead=50.0)
    ahead = turned(np.tile([100.0, 0.0, 0.0], (ROWS, 1)), observations["target"], ahead=False)
    np.testing.assert_allclose(control.actions(ahead, observations), np.tile([1.0, 0.0, 0.0], (ROWS, 1)), atol=1e-12)


def test_rows_are_those_of_the_single_environment_to_their_last_observation() -> None:
    envs, env = VelocityFlights(many(max_episode_steps=6)), VelocityFlight(single(max_episode_steps=6))
    rows, alone = envs.reset(seed=3)[0], env.reset(seed=3)[0]
    np.testing.assert_allclose(rows[0], alone, rtol=1e-5)
    rng = np.random.default_rng(1)
    for _ in range(6):
        actions = rng.uniform(-0.3, 0.3, (ROWS, 3)).astype(np.float32)
        rows, rewards, terminated, truncated, info = envs.step(actions)
        alone, reward, *ends, _ = env.step(actions[0])
        assert rewards[0] == pytest.approx(reward, abs=1e-9)
        assert (bool(terminated[0]), bool(truncated[0])) == tuple(ends)
        if not any(ends):
            np.testing.assert_allclose(rows[0], alone, rtol=1e-4, atol=1e-5)
    assert truncated.all()
    assert rows in envs.observation_space
    np.testing.assert_allclose(info["final_obs"][0], alone, rtol=1e-4, atol=1e-5)
    assert not np.allclose(rows[0], alone, rtol=1e-2)


@pytest.mark.parametrize("wrapper", [VelocityFlight, BoxObservations])
@pytest.mark.filterwarnings("ignore:.*Box.*infinity.*", "ignore:.*not within the observation.*")
def test_gymnasium_has_no_objection(wrapper: Any) -> None:
    check_env(wrapper(single()), skip_render_check=True, skip_close_check=True)


@pytest.mark.parametrize("name", ["QuadrotorCanyon", "RangeLocalisation"])
def test_what_is_no_flight_of_a_point_mass_is_refused(name: str) -> None:
    env = gymnasium.make(f"mathnavi/{name}-v1")
    with pytest.raises(ArgumentError, match=r"allowed: mathnavi/SafeFlight-v1"):
        VelocityFlight(env)


def test_an_action_before_any_episode_is_refused() -> None:
    with pytest.raises(ArgumentError, match="observation without time_left"):
        VelocityFlights(many()).step(np.zeros((ROWS, 3), np.float32))


@pytest.mark.parametrize("wrong", [{"response": 0.0}, {"ahead": -1.0}, {"up": np.inf}])
def test_a_control_that_is_none_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="allowed"):
        VelocityControl(**wrong)


@pytest.mark.parametrize("name", ["SafeFlight", "SimultaneousArrival", "TextbookObserver"])
def test_observations_are_boxes_of_float32_and_a_status_is_one_of_four(name: str) -> None:
    fields = FIELDS if name == "SafeFlight" else {}
    env = BoxObservations(gymnasium.make(f"mathnavi/{name}-v1", **fields))
    assert all(isinstance(space, gymnasium.spaces.Box) for space in env.observation_space.values())
    observation, _ = env.reset(seed=0)
    assert observation in env.observation_space
    np.testing.assert_array_equal(observation["status"].sum(axis=-1), 1.0)
    flat = gymnasium.wrappers.FlattenObservation(env)
    assert flat.reset(seed=0)[0].dtype == np.float32


def test_boxes_of_many_are_those_of_each() -> None:
    envs = BoxVectorObservations(many(max_episode_steps=1))
    observations, _ = envs.reset(seed=0)
    assert observations in envs.observation_space
    assert observations["status"].shape == (ROWS, 4)
    *_, info = envs.step(np.zeros((ROWS, 3)))
    assert info["final_obs"][1] in envs.single_observation_space


def test_a_script_of_cleanrl_reads_returns_and_last_observations() -> None:
    """Its lines: of ``ppo_continuous_action.py`` for returns, of ``td3_continuous_action.py`` for last observations."""
    envs = CleanRlEnv(VelocityFlights(many(max_episode_steps=4)))
    assert isinstance(envs.single_action_space, gymnasium.spaces.Box)
    obs, _ = envs.reset(seed=1)
    assert obs.reshape(ROWS, -1).shape == (ROWS, int(np.prod(envs.single_observation_space.shape)))
    returns, lengths, total = [], [], np.zeros(ROWS)
    for _ in range(8):
        next_obs, rewards, terminations, truncations, infos = envs.step(np.zeros((ROWS, 3), np.float32))
        total += rewards
        if "final_info" in infos:
            for info in infos["final_info"]:
                if info and "episode" in info:
                    returns.append(info["episode"]["r"])
                    lengths.append(info["episode"]["l"])
        real_next_obs = next_obs.copy()
        for idx, trunc in enumerate(truncations):
            if trunc:
                real_next_obs[idx] = infos["final_observation"][idx]
                assert not np.array_equal(real_next_obs[idx], next_obs[idx])
        assert not terminations.any()
    assert lengths == [4] * 2 * ROWS
    assert sum(returns) == pytest.approx(total.sum())


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED])
def test_other_resets_than_those_of_the_adapters_are_refused(mode: AutoresetMode) -> None:
    with pytest.raises(ArgumentError, match=r"autoreset_mode = .*; allowed: .*SAME_STEP"):
        CleanRlEnv(VelocityFlights(many(autoreset_mode=mode)))
