"""The environments of Gymnasium: its own checker, its registry, the same episodes as those of dm_env."""

from __future__ import annotations

import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from mathnavi.sim.environments.gym import ScenarioEnv
from mathnavi.sim.environments.registration import identifier
from mathnavi.sim.plugin.registry import names
from tests.sim.environments import missions


@pytest.mark.parametrize("scenario", missions.SCENARIOS)
def test_every_scenario_passes_the_checker_of_gymnasium(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mathnavi.sim.environments.gym.EpisodeRunner", lambda *_: missions.commanded(scenario))
    missions.assert_passes_gymnasium(ScenarioEnv(scenario))


def test_every_installed_scenario_is_registered() -> None:
    registered = {name for name in gymnasium.registry if name.startswith("mathnavi/")}
    assert registered == {identifier(scenario, version) for scenario in names("scenarios") for version in (0, 1)}
    assert "mathnavi/SafeFlight-v0" in registered


def test_what_gymnasium_makes_is_the_scenario_with_its_fields_and_passes_its_checker_whole() -> None:
    env = gymnasium.make("mathnavi/TextbookObserver-v0", system="krener-isidori", duration=0.05)
    assert env.action_space.shape == (1,)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check_env(env.unwrapped)
    env.reset(seed=3)
    ends = [env.step(np.zeros(1))[2:4] for _ in range(5)]
    assert ends == [(False, False)] * 4 + [(False, True)]
    with pytest.raises(ValueError, match="the episode is over; allowed: after reset"):
        env.unwrapped.step(np.zeros(1))


def test_a_step_before_the_first_episode_and_a_wrong_field_are_refused() -> None:
    env = ScenarioEnv("textbook-observer")
    with pytest.raises(ValueError, match="no episode has begun; allowed: after reset"):
        env.step(np.zeros(1))
    with pytest.raises(ValueError, match=r"speed is not a field; .*allowed: system"):
        gymnasium.make("mathnavi/TextbookObserver-v0", speed=1.0)


def test_without_gymnasium_one_error_says_how_to_install_it_and_dm_env_works() -> None:
    script = (
        "import sys, importlib.util as util; find = util.find_spec\n"
        "util.find_spec = lambda name, *more: None if name == 'gymnasium' else find(name, *more)\n"
        "sys.modules['gymnasium'] = None\n"
        "from mathnavi.sim.environments.dm import load\n"
        "import mathnavi.sim.environments.gym"
    )
    stderr = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False).stderr
    assert stderr.strip().splitlines()[-1].endswith("pip install 'gymnasium>=1.4,<1.5'")
    assert stderr.count("gymnasium>=1.4") == 2  # where it is raised, and what it says
