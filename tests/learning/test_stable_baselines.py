"""Many missions at once for Stable-Baselines3: its own checks, its normalisation, its PPO. Skipped without it."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.learning.boxes import BoxObservations, BoxVectorObservations
from mathnavi.learning.flights import VelocityFlight, VelocityFlights
from tests.learning.test_velocity import ROWS, many, single

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from mathnavi.learning.stable_baselines import StableBaselinesEnv


@pytest.mark.parametrize("wrapper", [VelocityFlight, BoxObservations])
@pytest.mark.filterwarnings("ignore")
def test_its_checker_has_no_objection(wrapper: Any) -> None:
    check_env(wrapper(single()))


def test_rows_are_those_of_its_own_vector_environment() -> None:
    """Observations, rewards, ends and what ``infos`` hold of them, against ``DummyVecEnv`` and ``Monitor``."""
    ours = StableBaselinesEnv(VelocityFlights(many(max_episode_steps=5)))
    theirs = DummyVecEnv([lambda: Monitor(VelocityFlight(single(max_episode_steps=5)))])
    ours.seed(4), theirs.seed(4)
    np.testing.assert_allclose(ours.reset()[0], theirs.reset()[0], rtol=1e-5)
    rng = np.random.default_rng(0)
    for _ in range(10):
        actions = rng.uniform(-0.3, 0.3, (ROWS, 3)).astype(np.float32)
        observations, rewards, over, infos = ours.step(actions)
        expected = theirs.step(actions[:1])
        np.testing.assert_allclose(observations[0], expected[0][0], rtol=1e-4, atol=1e-5)
        assert rewards[0] == pytest.approx(float(expected[1][0]), abs=1e-6)
        assert bool(over[0]) == bool(expected[2][0])
        assert (infos[0]["outcome"], infos[0]["events"]) == (expected[3][0]["outcome"], expected[3][0]["events"])
        assert infos[0]["clearance"] == pytest.approx(expected[3][0]["clearance"], abs=1e-3)
        if over[0]:
            one, other = infos[0], expected[3][0]
            np.testing.assert_allclose(one["terminal_observation"], other["terminal_observation"], rtol=1e-4, atol=1e-5)
            assert one["TimeLimit.truncated"] is other["TimeLimit.truncated"] is True
            assert one["episode"]["r"] == pytest.approx(other["episode"]["r"], abs=1e-5)
            assert one["episode"]["l"] == other["episode"]["l"] == 5


def test_a_status_in_boxes_is_normalised() -> None:
    envs = VecNormalize(StableBaselinesEnv(BoxVectorObservations(many(max_episode_steps=5))))
    envs.reset()
    for _ in range(6):
        observations, *_ = envs.step(np.zeros((ROWS, 3)))
    assert observations["status"].shape == (ROWS, 4)
    assert np.isfinite(np.concatenate([value.ravel() for value in observations.values()])).all()
    with pytest.raises(ValueError, match="status"):
        VecNormalize(DummyVecEnv([single]))


LEARNING = """
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from mathnavi.learning.flights import VelocityFlights
from mathnavi.learning.stable_baselines import StableBaselinesEnv
from tests.learning.test_velocity import many
envs = StableBaselinesEnv(VelocityFlights(many(max_episode_steps=8)))
policy = PPO("MlpPolicy", envs, n_steps=16, batch_size=16, n_epochs=1, seed=0, device="cpu")
policy.learn(2 * 16 * envs.num_envs)
assert {episode["l"] for episode in policy.ep_info_buffer} == {8}
assert np.isfinite(evaluate_policy(policy, envs, n_eval_episodes=3)).all()
"""


def test_ppo_learns_from_it_and_is_evaluated() -> None:
    """In a process of its own, without OpenGL: PyTorch's optimisers import Triton, whose LLVM clashes with Mesa's."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    subprocess.run([sys.executable, "-c", LEARNING], check=True, env=environment)


def test_what_rows_that_are_one_environment_cannot_do_is_refused() -> None:
    envs = StableBaselinesEnv(VelocityFlights(many()))
    with pytest.raises(ArgumentError, match="one environment"):
        envs.set_attr("hold", 1.0)
    with pytest.raises(ArgumentError, match="one environment"):
        envs.env_method("render")
    assert envs.get_attr("hold", [0, 2]) == [0.5, 0.5]
    assert envs.env_is_wrapped(gymnasium.Wrapper) == [False] * ROWS
