"""Many missions at once: the numbers of the single environments, episode after episode, and what is refused."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

import mathnavi.sim.environments  # noqa: F401  makes them known to Gymnasium
from mathnavi.sim.environments.gym import LearningEnv
from mathnavi.sim.environments.vector import SafeFlightVectorEnv
from tests.sim.environments import missions

ROWS = 3
FIELDS: dict[str, Any] = {
    "terrain": missions.hills(),
    "target": (7000.0, 3000.0, 800.0),
    "drawn_separation": (0.2, 0.6),
    "noise": {"position": 2.0},
    "faults": {"gust_rms": 0.5},
}


def same(found: Any, expected: Any) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-6)  # metres, after hundreds of steps of rounding


def test_every_row_is_the_single_environment_episode_after_episode() -> None:
    """Contacts, gusts, noise, ends and first observations of the next episodes."""
    options = {"discount": 0.99, **FIELDS}
    envs = gymnasium.make_vec("mathnavi/SafeFlight-v1", num_envs=ROWS, seed=5, **options)
    assert isinstance(envs.unwrapped, SafeFlightVectorEnv)
    single = [LearningEnv("safe-flight", 5 + i, **options) for i in range(ROWS)]
    observations, info = envs.reset(seed=3)
    for i, env in enumerate(single):
        seen, said = env.reset(seed=3 + i)
        assert said["seed"] == info["seed"][i]
        for name, value in seen.items():
            same(observations[name][i], value)
    rng, outcomes = np.random.default_rng(0), []
    for _ in range(70):
        actions = rng.uniform(-30.0, 30.0, (ROWS, 3))
        actions[0, 2] -= 15.0
        actions[1] += [20.0, 0.0, 3.0]
        observations, rewards, ended, truncated, info = envs.step(actions)
        assert not truncated.any()
        for i, env in enumerate(single):
            seen, reward, over, _, said = env.step(np.clip(actions[i], -40.0, 40.0))
            same(rewards[i], reward)
            assert ended[i] == over
            if over:
                last = {name: info["final_info"][name][i] for name in said}
                assert (last["outcome"], last["events"]) == (said["outcome"], said["events"])
                same(last["clearance"], said["clearance"])
                outcomes.append(said["outcome"])
                for name, value in seen.items():
                    same(info["final_obs"][i][name], value)
                seen, said = env.reset()
                assert said["seed"] == info["seed"][i]
            for name, value in seen.items():
                same(observations[name][i], value)
            assert (info["outcome"][i], info["events"][i]) == (said["outcome"], said["events"])
            same(info["clearance"][i], said["clearance"])
    assert {"crashed", "off the map"} <= set(outcomes)


def test_observations_and_actions_are_in_their_spaces_and_missions_are_shared_in_turn() -> None:
    envs = SafeFlightVectorEnv(4, seed=1, missions=2, **{**FIELDS, "noise": {}, "faults": {}})
    observations, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(observations)
    same(observations["target"][:2], observations["target"][2:])
    assert not np.allclose(observations["target"][0], observations["target"][1])
    before = envs.step(np.zeros((4, 3)))[1]
    assert (before < 0.0).all()  # hovering costs its time
    assert envs.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP


def test_the_hull_touches_where_mujoco_has_it_and_not_before() -> None:
    """Down onto a slope at rest: a row is handed to MuJoCo near the ground, and lives until its hull is there."""
    envs = SafeFlightVectorEnv(1, seed=1, hold=1.0 / 60.0, **{**FIELDS, "noise": {}, "faults": {}})
    envs.reset(seed=0)
    lowest, over = np.inf, False
    while not over:
        _, _, ended, _, info = envs.step(np.array([[0.0, 0.0, -2.0]]))
        over = bool(ended[0])
        lowest = lowest if over else min(lowest, float(info["clearance"][0]))
    assert info["final_info"]["outcome"][0] == "crashed"
    assert 0.5 <= lowest < 2.0


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"target_path": ((10.0, 7000.0, 3500.0, 800.0),)}, "target_path = ((10.0,"),
        ({"faults": {"dropout_rate": 0.5}}, "faults.dropout_rate = 0.5 is not computed for many missions at once"),
        ({"estimator": "kalman"}, "estimator = 'kalman' is not computed for many missions at once"),
        ({"missions": 0}, "missions = 0; allowed: a whole number >= 1"),
    ],
)
def test_what_is_not_computed_for_many_is_refused(options: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match="allowed") as refusal:
        SafeFlightVectorEnv(2, **{**FIELDS, **options})
    assert expected in str(refusal.value)


def test_a_wrong_action_and_a_step_before_the_first_episode_are_refused() -> None:
    envs = SafeFlightVectorEnv(2, missions=1, **FIELDS)
    with pytest.raises(ValueError, match="no episode has begun; allowed: after reset"):
        envs.step(np.zeros((2, 3)))
    envs.reset(seed=0)
    for actions, expected in ((np.zeros((3, 3)), "shape (3, 3); allowed: (2, 3)"), (np.full((2, 3), np.nan), "finite")):
        with pytest.raises(ValueError, match="allowed") as refusal:
            envs.step(actions)
        assert expected in str(refusal.value)
