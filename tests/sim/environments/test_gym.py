"""The environments of Gymnasium: its own checker, its registry, its wrappers, copies, and what is refused."""

from __future__ import annotations

import copy
import json
import pickle
import subprocess
import sys
import types
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordVideo

from mathnavi.sim.environments.dm import Environment, FilteredEnvironment, load, load_learning
from mathnavi.sim.environments.gym import LearningEnv, SafetyFilterWrapper, ScenarioEnv
from mathnavi.sim.environments.registration import identifier
from mathnavi.sim.plugin.registry import names
from tests.sim.environments import missions


@pytest.mark.parametrize("scenario", missions.SCENARIOS)
def test_every_scenario_passes_the_checker_of_gymnasium(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    missions.assert_passes_gymnasium(identifier(scenario, 0), monkeypatch)


def test_every_installed_scenario_is_registered_in_both_versions_and_without_one() -> None:
    registered = {name for name in gymnasium.registry if name.startswith("mathnavi/")}
    known = {identifier(scenario, version) for scenario in names("scenarios") for version in (0, 1)}
    assert registered == known | {name.removesuffix("-v0") for name in known if name.endswith("-v0")}
    assert "mathnavi/SafeFlight-v0" in registered


def test_neither_version_is_out_of_date_and_the_last_is_meant_without_one() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for ending, made in (("-v0", "-v0"), ("-v1", "-v1"), ("", "-v1")):
            spec = gymnasium.make(f"mathnavi/TextbookObserver{ending}").spec
            assert spec is not None
            assert spec.id == f"mathnavi/TextbookObserver{made}"


@pytest.mark.refused("environment", "unknown options of reset")
@pytest.mark.parametrize("options", [{"nonsense": 1}, {"reset_mask": np.array([True])}, [1]])
def test_unknown_options_are_refused_and_begin_no_episode(options: Any) -> None:
    env = ScenarioEnv("textbook-observer")
    env.reset(seed=1, options={})
    state = env.np_random.bit_generator.state
    with pytest.raises(ValueError, match=r"options(: '\w+' is not known; allowed: none| = \[1\]; allowed: a mapping)"):
        env.reset(seed=2, options=options)
    assert env.np_random.bit_generator.state == state


COPIES = [copy.deepcopy, lambda whole: pickle.loads(pickle.dumps(whole))]


@pytest.mark.honoured("environment", "pickle and deepcopy")
@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize(
    "make",
    [
        lambda: ScenarioEnv("textbook-observer", 2, duration=0.05),
        lambda: gymnasium.make("mathnavi/TextbookObserver-v1", hold=0.02, covariance=True),
        lambda: SafetyFilterWrapper(ScenarioEnv("safe-flight", 2, **missions.fields("safe-flight"))),
    ],
)
def test_a_copy_has_the_mission_and_the_episodes_that_come_next(
    make: Callable[[], Any], copied: Callable[[Any], Any]
) -> None:
    env = make()
    env.reset(seed=8)
    env.step(np.zeros(env.action_space.shape))
    other = copied(env)
    assert other.spec == env.spec
    with pytest.raises(ValueError, match="no episode has begun; allowed: after reset"):
        other.unwrapped.step(np.zeros(env.action_space.shape))
    for _ in range(2):
        np.testing.assert_equal(other.reset(), env.reset())
        for _ in range(2):
            action = env.action_space.sample() if np.isfinite(env.action_space.high).all() else np.ones(1)
            np.testing.assert_equal(other.step(action), env.step(action))


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize(
    "make",
    [
        lambda: load("textbook-observer", seed=2),
        lambda: load_learning("textbook-observer", seed=2),
        lambda: FilteredEnvironment(load("safe-flight", seed=2, **missions.fields("safe-flight"))),
    ],
)
def test_a_copy_of_an_environment_of_dm_env_goes_on_with_the_next_episode(
    make: Callable[[], Any], copied: Callable[[Any], Any]
) -> None:
    one = make()
    one.reset()
    action = np.ones(one.action_spec().shape)
    one.step(action)
    other = copied(one)
    inner = other if isinstance(other, Environment) else other.environment
    assert inner.fresh
    np.testing.assert_equal(other.step(action), one.reset())  # it has no episode, so a step begins one
    np.testing.assert_equal(other.step(action), one.step(action))
    assert other.action_spec() == one.action_spec()
    assert other.observation_spec() == one.observation_spec()


@pytest.mark.honoured("environment", "EnvSpec as JSON, with wrappers")
def test_a_specification_that_was_json_makes_the_same_environment() -> None:
    fields = missions.fields("safe-flight")
    env = SafetyFilterWrapper(gymnasium.make("mathnavi/SafeFlight-v0", seed=2, max_episode_steps=9, **fields))
    assert env.spec is not None
    text = env.spec.to_json()
    other = gymnasium.make(EnvSpec.from_json(text))
    assert str(other) == str(env)
    np.testing.assert_equal(other.reset(seed=3), env.reset(seed=3))
    np.testing.assert_equal(other.step(np.ones(3)), env.step(np.ones(3)))
    wrong = json.loads(text)
    wrong["kwargs"]["target"] = "there"
    with pytest.raises(ValueError, match=r"^target = 'there'; allowed: "):
        gymnasium.make(EnvSpec.from_json(json.dumps(wrong)))


@pytest.mark.honoured("environment", "RecordVideo of Gymnasium, size of the picture")
def test_gymnasium_records_an_episode_in_the_size_that_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clips: list[Any] = []

    class Clip:
        """Stands in for the encoder of MoviePy."""

        def __init__(self, frames: list[Any], fps: int) -> None:
            self._content = (np.shape(frames), fps)

        def write_videofile(self, path: str, **_: Any) -> None:
            clips.append((Path(path).name, *self._content))

    module = types.ModuleType("moviepy.video.io.ImageSequenceClip")
    module.ImageSequenceClip = Clip  # type: ignore[attr-defined]
    for name in ("moviepy", "moviepy.video", "moviepy.video.io"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    size = {"render_mode": "rgb_array", "width": 65, "height": 33}
    env = RecordVideo(gymnasium.make("mathnavi/TextbookObserver-v1", max_episode_steps=3, **size), str(tmp_path / "v"))
    env.reset(seed=1)
    ends = [env.step(env.action_space.sample())[2:4] for _ in range(3)]
    env.close()
    assert ends == [(False, False), (False, False), (False, True)]
    assert clips == [("rl-video-episode-0.mp4", (4, 33, 65, 3), 30)]


@pytest.mark.refused("environment", "sizes of a picture that are no whole numbers from 16 to 8192")
@pytest.mark.parametrize("size", [{"width": "640"}, {"height": 0}, {"width": None}, {"height": 64.0}, {"width": 9000}])
def test_a_size_that_is_none_is_refused(size: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=rf"^{next(iter(size))} = .*; allowed: a whole number from 16 to 8192 pixels$"):
        LearningEnv("textbook-observer", **size)


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
