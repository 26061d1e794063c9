"""Many missions at once: the numbers of the single environments, episode after episode, and what is refused."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers import TimeLimit, vector

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


STILL = np.zeros((ROWS, 3))


def assert_same(found: Any, expected: Any) -> None:
    """Equal in keys, shapes, kinds and masks; numbers up to hundreds of steps of rounding, [m]."""
    if isinstance(expected, dict):
        assert found.keys() == expected.keys()
        for name in expected:
            assert_same(found[name], expected[name])
    elif isinstance(expected, (tuple, list)) or (isinstance(expected, np.ndarray) and expected.dtype == object):
        for one, other in zip(found, expected, strict=True):
            assert_same(one, other)
    elif isinstance(expected, (np.ndarray, np.number, float, int)):
        assert np.asarray(found).dtype == np.asarray(expected).dtype
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-6)
    else:
        assert found == expected


@pytest.fixture(scope="module")
def singles() -> list[gymnasium.Env[Any, Any]]:
    """Environments of three missions, with gusts and noise, each episode at most 16 steps long."""
    return [TimeLimit(LearningEnv("safe-flight", 5 + i, discount=0.99, **FIELDS), 16) for i in range(ROWS)]


def both(singles: list[gymnasium.Env[Any, Any]], mode: AutoresetMode) -> tuple[VectorEnv, SyncVectorEnv]:
    """The three missions as rows, here and by Gymnasium."""
    options = {"seed": 5, "discount": 0.99, "autoreset_mode": mode, "max_episode_steps": 16, **FIELDS}
    rows = gymnasium.make_vec("mathnavi/SafeFlight-v1", num_envs=ROWS, **options)
    assert isinstance(rows.unwrapped, SafeFlightVectorEnv)
    return rows, SyncVectorEnv([lambda env=env: env for env in singles], autoreset_mode=mode)  # type: ignore[misc]


@pytest.mark.honoured("environment", "autoreset mode SAME_STEP, NEXT_STEP, DISABLED")
@pytest.mark.honoured("environment", "max_episode_steps")
@pytest.mark.parametrize("mode", AutoresetMode)
def test_every_row_is_gymnasiums_row_of_the_single_environment(mode: AutoresetMode, singles: list[Any]) -> None:
    """Contacts, gusts, noise, ends, step limits, info, and first observations of the next episodes."""
    rows, expected = both(singles, mode)
    assert rows.metadata["autoreset_mode"] is expected.metadata["autoreset_mode"]
    assert_same(rows.reset(seed=3), expected.reset(seed=3))
    rng, ends, over = np.random.default_rng(0), set(), np.zeros(ROWS, dtype=bool)
    for _ in range(48):
        actions = rng.uniform(-30.0, 30.0, (ROWS, 3))
        actions[0, 2] -= 30.0
        actions[2] += [0.0, -60.0, 3.0]
        if mode is AutoresetMode.DISABLED and over.any():
            mask, seeds = over.copy(), [int(rng.integers(1000)), None, 7]
            assert_same(
                rows.reset(seed=seeds, options={"reset_mask": mask}),
                expected.reset(seed=seeds, options={"reset_mask": mask.copy()}),
            )
        made = rows.step(actions)
        assert_same(made, expected.step(np.clip(actions, -40.0, 40.0)))
        over = made[2] | made[3]
        final = made[4].get("final_info", made[4])["outcome"]
        ends |= {(final[i], bool(made[3][i])) for i in np.flatnonzero(over)}
    assert {("crashed", False), ("off the map", False), ("", True)} <= ends


def flat(envs: Any) -> Any:
    return vector.FlattenObservation(envs)


@pytest.mark.honoured("environment", "vector wrappers of Gymnasium")
@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize(
    "wrapped",
    [
        vector.RecordEpisodeStatistics,
        vector.DictInfoToList,
        vector.NormalizeReward,
        vector.ClipAction,
        lambda envs: vector.ClipReward(envs, -0.01, 0.01),
        lambda envs: vector.TransformReward(envs, lambda reward: 2.0 * reward),
        lambda envs: vector.RescaleAction(envs, -1.0, 1.0),
        lambda envs: vector.TransformAction(envs, lambda action: 0.5 * action),
        lambda envs: vector.FilterObservation(envs, ["velocity", "target"]),
        flat,
        lambda envs: vector.NormalizeObservation(flat(envs)),
        lambda envs: vector.TransformObservation(flat(envs), np.tanh),
        lambda envs: vector.DtypeObservation(flat(envs), np.float64),
        lambda envs: vector.ReshapeObservation(flat(envs), (*flat(envs).single_observation_space.shape, 1)),
        lambda envs: vector.RecordEpisodeStatistics(vector.NormalizeReward(vector.NormalizeObservation(flat(envs)))),
    ],
)
def test_a_wrapper_of_gymnasium_does_what_it_does_around_its_own_rows(
    wrapped: Callable[[Any], Any], mode: AutoresetMode, singles: list[Any]
) -> None:
    """Those that take a mode of SyncVectorEnv take it here, and give the same."""
    rows, expected = both(singles, mode)
    try:
        other = wrapped(expected)
    except ValueError:
        assert mode is not AutoresetMode.NEXT_STEP
        with pytest.raises(ValueError, match="autoreset_mode"):
            wrapped(rows)
        return
    one, over = wrapped(rows), np.zeros(ROWS, dtype=bool)
    assert_same(one.reset(seed=3), other.reset(seed=3))
    down = np.clip(
        np.array([[0.0, 0.0, -40.0], [1.0, 2.0, 3.0], [0.0, -40.0, 3.0]]), one.action_space.low, one.action_space.high
    )
    for _ in range(18):
        if mode is AutoresetMode.DISABLED and over.any():
            for envs in (rows, expected):
                envs.reset(options={"reset_mask": over.copy()})
        made, wanted = one.step(down), other.step(down)
        for each in (made, wanted):
            if isinstance(each[4], dict) and "episode" in each[4]:
                assert each[4]["episode"].pop("t") is not None  # a wall-clock time
        assert_same(made, wanted)
        over = made[2] | made[3]


@pytest.mark.honoured("environment", "reset_mask, with and without seeds")
def test_a_mask_resets_its_rows_and_no_others(singles: list[Any]) -> None:
    rows, expected = both(singles, AutoresetMode.SAME_STEP)
    assert_same(rows.reset(seed=1), expected.reset(seed=1))
    for seed in (None, 4, [9, None, 8]):
        assert_same(rows.step(STILL), expected.step(STILL))
        options = {"reset_mask": np.array([True, False, True])}
        assert_same(rows.reset(seed=seed, options=options), expected.reset(seed=seed, options=dict(options)))
        assert set(options) == {"reset_mask"}  # wrappers around it read it afterwards
        assert rows.unwrapped.np_random_seed == expected.np_random_seed
    assert_same(rows.step(STILL), expected.step(STILL))


@pytest.mark.refused("environment", "reset_mask of another length, dtype or kind, or without a row")
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"reset_mask": np.array([True])}, r"array of bool of shape \(1,\); allowed: .* \(3,\)"),
        ({"reset_mask": np.ones((ROWS, 1), dtype=bool)}, r"shape \(3, 1\); allowed"),
        ({"reset_mask": np.array([1, 0, 1])}, r"array of int64 of shape \(3,\); allowed: an array of bool"),
        ({"reset_mask": [True, False, True]}, r"reset_mask is a list; allowed: an array of bool"),
        ({"reset_mask": np.zeros(ROWS, dtype=bool)}, r"False in every row; allowed: .* at least one True"),
        ({"reset_mask": None}, r"reset_mask is a NoneType; allowed"),
        ({"nonsense": 1}, r"^options: 'nonsense' is not known; allowed: reset_mask"),
    ],
)
def test_wrong_options_are_refused_as_by_gymnasium_and_change_nothing(
    options: dict[str, Any], words: str, singles: list[Any]
) -> None:
    rows, expected = both(singles, AutoresetMode.SAME_STEP)
    before, _ = rows.reset(seed=1)
    with pytest.raises((ValueError, TypeError)):
        expected.reset(seed=1, options=dict(options))
    with pytest.raises(ValueError, match=words):
        rows.reset(seed=2, options=options)
    again, _ = rows.reset(seed=1)
    assert_same(again, before)


@pytest.mark.refused("environment", "seeds of another number, negative or not whole")
@pytest.mark.parametrize("seed", [[1, 2], [1, 2, -3], -1, 1.5, "7", True, [[1], [2], [3]]])
def test_wrong_seeds_are_refused_before_any_row_is_changed(seed: Any) -> None:
    envs = SafeFlightVectorEnv(ROWS, missions=1, **FIELDS)
    envs.reset(seed=1)
    seeders = [each.bit_generator.state for each in envs.np_random]
    with pytest.raises(ValueError, match=r"^seed (=|holds) .*; allowed: "):
        envs.reset(seed=seed)
    assert seeders == [each.bit_generator.state for each in envs.np_random]


def test_rows_that_cannot_go_on_are_named_and_a_mask_needs_episodes() -> None:
    envs = SafeFlightVectorEnv(2, missions=1, autoreset_mode="Disabled", max_episode_steps=1, **FIELDS)
    mask = np.array([True, False])
    with pytest.raises(ValueError, match="reset_mask before any episode; allowed: after a reset"):
        envs.reset(options={"reset_mask": mask})
    envs.reset(seed=0)
    assert envs.step(np.zeros((2, 3)))[3].tolist() == [True, True]
    envs.reset(options={"reset_mask": mask})
    with pytest.raises(ValueError, match=r"the episodes of rows \[1\] are over; allowed: after reset"):
        envs.step(np.zeros((2, 3)))


@pytest.mark.honoured("environment", "pickle and deepcopy")
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda envs: pickle.loads(pickle.dumps(envs))])
def test_a_copy_has_the_same_missions_and_the_episodes_that_come_next(copied: Callable[[Any], Any]) -> None:
    envs = SafeFlightVectorEnv(2, seed=1, autoreset_mode="NextStep", max_episode_steps=5, **FIELDS)
    envs.reset(seed=8)
    other = copied(envs)
    assert other.metadata == envs.metadata
    with pytest.raises(ValueError, match="no episode has begun; allowed: after reset"):
        other.step(np.zeros((2, 3)))
    assert_same(other.reset(), envs.reset())
    assert_same(other.step(np.ones((2, 3))), envs.step(np.ones((2, 3))))


def test_observations_and_actions_are_in_their_spaces_and_missions_are_shared_in_turn() -> None:
    envs = SafeFlightVectorEnv(4, seed=1, missions=2, **{**FIELDS, "noise": {}, "faults": {}})
    observations, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(observations)
    assert_same(observations["target"][:2], observations["target"][2:])
    assert not np.allclose(observations["target"][0], observations["target"][1])
    before = envs.step(np.zeros((4, 3)))[1]
    assert (before < 0.0).all()  # hovering costs its time
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP


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
        ({"width": 64}, "width = 64 is not computed for many missions at once"),
        ({"autoreset_mode": "NEXT"}, "autoreset_mode = 'NEXT'; allowed: an AutoresetMode, or 'NextStep', 'SameStep', "),
        ({"max_episode_steps": 0}, "max_episode_steps = 0; allowed: a whole number >= 1, or -1 or None for no limit"),
        ({"max_episode_steps": 2.0}, "max_episode_steps = 2.0; allowed: a whole number"),
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
