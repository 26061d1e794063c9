"""A learner answers anything, and writes into all that it is given: an episode is as it would be without that."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.environments.dm import FilteredEnvironment
from mathnavi.sim.environments.gym import LearningEnv, SafetyFilterWrapper, ScenarioEnv
from mathnavi.sim.environments.vector import SafeFlightVectorEnv
from tests.sim.environments import missions


class Raises:
    """An object that cannot be an array."""

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("a bug")


class Turns:
    """An action that is another one when it is looked at again."""

    def __init__(self) -> None:
        self.looks = 0

    def __array__(self, *_: Any, **__: Any) -> Any:
        self.looks += 1
        return np.full(3, np.nan) if self.looks > 1 else np.ones(3)


REFUSED: dict[str, Any] = {
    "none": None, "a number": 3.0, "text": "123", "words": ["a", "b", "c"], "numbers as text": ["1", "2", "3"],
    "bytes": b"abc", "a mapping": {"a": 1}, "a set": {1, 2, 3}, "a class": float, "ragged": [[1.0], [2.0, 3.0]],
    "objects": np.array([None, 1.0, 2.0], object), "an object": Raises(), "complex": np.array([1j, 0.0, 0.0]),
    "times": np.array([1, 2, 3], "datetime64[s]"), "an integer that is huge": [10**400, 0, 0], "two": np.zeros(2),
    "a column": np.zeros((3, 1)), "nan": np.array([np.nan, 0.0, 0.0]), "inf": np.array([0.0, np.inf, 0.0]),
    "huge": np.array([0.0, 0.0, 1e200]), "longer than any": np.array([1e4000, 0, 0], np.longdouble),
}  # fmt: skip
ACCEPTED: dict[str, Any] = {
    "a list": [1.0, 2.0, 3.0], "a tuple": (1, 2, 3), "integers": np.array([1, 2, 3]),
    "half": np.array([1, 2, 3], np.float16), "read-only": np.broadcast_to(np.float64(1.0), 3),
}  # fmt: skip


def alone(kind: str) -> Any:
    """The environment of a safe flight."""
    if kind == "vector":
        return SafeFlightVectorEnv(2, seed=1, missions=1, **missions.fields("safe-flight"))
    if kind in ("filtered", "filtered by dm_env"):
        environment = missions.environment("safe-flight")
        return (
            FilteredEnvironment(environment)
            if kind == "filtered by dm_env"
            else SafetyFilterWrapper(ScenarioEnv("safe-flight"))
        )
    return {"v0": ScenarioEnv, "v1": LearningEnv}[kind]("safe-flight")


@pytest.fixture(autouse=True)
def built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mathnavi.sim.environments.gym.EpisodeRunner", lambda spec: missions.commanded(spec.scenario))


@pytest.mark.refused("plug-in", "learner: an action that is none")
@pytest.mark.parametrize("kind", ["v0", "v1", "vector", "filtered", "filtered by dm_env"])
def test_what_is_no_action_is_refused_in_one_line_and_the_episode_goes_on_as_before(kind: str) -> None:
    envs = alone(kind)
    envs.reset()
    for name, action in REFUSED.items():
        of_rows = [action, action] if kind == "vector" else action
        with pytest.raises(ArgumentError, match=r"^actions?(\[0\])? (has|have|=) [^\n]*; allowed: "):
            envs.step(of_rows)
        assert name
    for action in ACCEPTED.values():
        envs.step([action, action] if kind == "vector" else action)


def test_an_action_is_looked_at_once() -> None:
    env = SafetyFilterWrapper(ScenarioEnv("quadrotor-canyon"))
    env.reset(seed=1)
    action = Turns()
    env.step(action)  # type: ignore[arg-type]  # held for several periods of the tracker
    assert action.looks == 1


def deface(value: Any) -> None:
    """Write into all that a value holds, and into what its arrays are views of."""
    if isinstance(value, np.ndarray):
        for array in (value, value.base):
            if isinstance(array, np.ndarray):
                for each in array.flat if array.dtype == object else ():
                    deface(each)
                array[...] = None if array.dtype == object else 77
    elif isinstance(value, dict):
        for each in value.values():
            deface(each)
        value.clear()
    elif hasattr(value, "spaces"):
        deface(dict(value.spaces))
    elif hasattr(value, "low"):
        deface(value.low)
        deface(value.high)


def played(make: Callable[[], Any], touch: Callable[[Any], None]) -> list[Any]:
    env, rng = make(), np.random.default_rng(0)
    begun = env.reset(seed=3)
    out = [copy.deepcopy(begun)]
    for space in ("action_space", "observation_space", "single_action_space", "single_observation_space"):
        shape = env.action_space.shape
        touch(getattr(env, space, None))
    for each in begun:
        touch(each)
    for _ in range(5):
        action = 30.0 * rng.normal(size=shape)
        made = env.step(action)
        out.append(copy.deepcopy(made))
        for each in (*made, action):
            touch(each)
    return out


@pytest.mark.parametrize("kind", ["v0", "v1", "vector", "filtered"])
def test_what_a_learner_writes_into_what_it_was_given_changes_no_episode(kind: str) -> None:
    one, other = (played(lambda: alone(kind), touch) for touch in (lambda _: None, deface))
    np.testing.assert_equal(other, one)
