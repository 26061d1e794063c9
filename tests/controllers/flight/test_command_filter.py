"""The safety filter: what is flown is certified, a certified command is left alone, and the others change little."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.command_filter import CommandFilter
from mathnavi.controllers.flight.guarantee import GuaranteeState
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.interfaces.signals import Array, Estimate, Message, Status
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.aerial.knowledge import TERRAIN
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.terrain.height_field import HeightField
from tests.flight import at_rest, mission

BANDWIDTH = 0.8
H = 1.0 / 60.0  # [s] the control period


@cache
def across(**fields: Any) -> FlightMission:
    return mission(**fields)


def filter_of(task: FlightMission, candidates: int = 32) -> CommandFilter:
    bound = tracking_bound(BANDWIDTH, task)
    return CommandFilter(task, CriticallyDamped(H, BANDWIDTH, bound), candidates)


def certificate_of(task: FlightMission) -> Certificate:
    bound = tracking_bound(BANDWIDTH, task)
    return Certificate.for_mission(task, bound, CriticallyDamped(H, BANDWIDTH, bound).held)


def random_commands(rng: np.random.Generator, steps: int, longest: float = 60.0) -> Array:
    """(steps, 3) [m/s^2], each held for some time, many of them beyond the bounds."""
    commands = rng.normal(0.0, 0.5 * longest, (steps, 3))
    return np.repeat(commands[::40], 40, axis=0)[:steps]


@pytest.mark.parametrize("seed", range(2))
def test_what_is_flown_is_certified_and_clear_whatever_is_proposed(seed: int) -> None:
    task, rng = across(), np.random.default_rng(seed)
    certificate, safe, x = certificate_of(task), filter_of(task), at_rest(task.start)
    flown = set()
    for k, proposed in enumerate(random_commands(rng, 600)):
        answer = safe.step(k * H, Estimate(k * H, x), proposed)
        flown.add(answer.flown)
        assert not answer.announced
        if answer.flown == "proposed":
            assert np.array_equal(answer.u, proposed)
            assert not answer.reason
        if answer.flown != "stored plan":  # the plan behind the command starts with it, from here
            assert certificate.check(safe.stored) is None
            assert np.array_equal(safe.stored.x[0], x)
            assert np.array_equal(safe.stored.u[0], answer.u)
        assert answer.margin >= 0.0
        assert task.terrain.arc_clearance(x[:3], x[3:], answer.u, H) >= task.clearance_min
        x = flow(x, answer.u, H)
        assert np.linalg.norm(x[3:]) <= task.speed_max
    assert flown >= {"proposed", "nearest"}


def test_a_command_that_is_certified_is_left_alone_bit_for_bit_and_one_into_the_ground_is_not() -> None:
    task = across()
    x = at_rest((*task.start[:2], task.start[2] + 500.0))
    for proposed in np.random.default_rng(1).uniform(-20.0, 20.0, (20, 3)):
        answer = filter_of(task).step(0.0, Estimate(0.0, x), proposed)
        assert answer.u.tobytes() == proposed.tobytes()
    diving = np.array([*task.start[:2], task.start[2] - 80.0, 0.0, 0.0, -60.0])
    answer = filter_of(task).step(0.0, Estimate(0.0, diving), np.array([0.0, 0.0, -30.0]))
    assert answer.intervened
    assert answer.reason


def diving(task: FlightMission, x: Array) -> Array:
    """The command (3,) [m/s^2] of a policy that flies at the target and below it."""
    ahead = np.array(task.target) - x[:3]
    wanted = 200.0 * ahead / np.linalg.norm(ahead) - [0.0, 0.0, 60.0]
    return np.clip(wanted - x[3:], -20.0, 20.0)


def test_more_candidates_change_a_command_no_more() -> None:
    task = across()
    safe, x, changed = filter_of(task), at_rest((*task.start[:2], task.start[2] + 300.0)), 0
    for k in range(1500):
        proposed = diving(task, x)
        if k % 15 == 0:
            distances = []
            for candidates in (1, 2, 5, 9, 16, 24, 32):
                answer = filter_of(task, candidates).step(0.0, Estimate(0.0, x), proposed)
                if answer.flown == "stored plan":
                    assert not distances
                else:
                    distances.append(float(np.linalg.norm(answer.u - proposed)))
            assert distances == sorted(distances, reverse=True)
            changed += len(set(distances)) > 1
        x = flow(x, safe.step(k * H, Estimate(k * H, x), proposed).u, H)
    assert changed >= 3


def test_of_commands_beyond_a_bound_the_nearest_within_is_flown() -> None:
    task = across()
    a_max = certificate_of(task).acceleration_max
    x = at_rest((*task.start[:2], task.start[2] + 800.0))
    proposed = np.array([30.0, -50.0, 20.0])
    answer = filter_of(task).step(0.0, Estimate(0.0, x), proposed)
    assert answer.flown == "nearest"
    np.testing.assert_allclose(answer.u, proposed * a_max / np.linalg.norm(proposed), rtol=1e-6)


def test_near_the_ground_the_nearest_command_gives_up_only_what_leads_into_it() -> None:
    """Level over a plain, at the least height: of a dive forward the way forward is left."""
    plain = HeightField(np.zeros((61, 61)), 200.0)
    task = FlightMission(plain, (2000.0, 2000.0, 51.0), (9000.0, 9000.0, 100.0))
    safe = filter_of(task)
    x = np.array([2000.0, 2000.0, task.clearance_min + safe.bound.vertical + 1e-3, 40.0, 0.0, 0.0])
    answer = safe.step(0.0, Estimate(0.0, x), np.array([10.0, 0.0, -20.0]))
    assert answer.flown == "nearest"
    assert answer.u[0] == pytest.approx(10.0, abs=0.5)
    assert -2.0 * 1e-3 / H**2 <= answer.u[2] <= -1.0  # the room that there is, used up within the period


def test_in_gusts_and_noise_as_declared_the_ground_is_clear_under_a_diving_policy() -> None:
    gust, noise = DeclaredGusts(1.5, 3.0), 2.0
    bare = across(gust=gust, position_noise=noise)
    task = mission(gust=gust, position_noise=noise, quality=bare.full_state_quality(None, H))
    rng = np.random.default_rng(5)
    safe, x, w = filter_of(task), at_rest((*task.start[:2], task.start[2] + 300.0)), np.zeros(3)
    for k in range(1500):
        seen = x + np.concatenate([noise * rng.normal(size=3), np.zeros(3)])
        answer = safe.step(k * H, Estimate(k * H, seen), diving(task, seen))
        assert not answer.announced
        w = w * np.exp(-H / gust.time_constant) + gust.rms * np.sqrt(1.0 - np.exp(-2.0 * H / 3.0)) * rng.normal(size=3)
        assert task.terrain.arc_clearance(x[:3], x[3:], answer.u + w, H) >= task.clearance_min
        x = flow(x, answer.u + w, H)


def test_a_lost_estimate_is_announced_and_the_stored_plan_flown() -> None:
    task = across()
    safe, x = filter_of(task), at_rest((*task.start[:2], task.start[2] + 300.0))
    command = np.array([5.0, 0.0, 0.0])
    assert not safe.step(0.0, Estimate(0.0, x), command).announced
    later = flow(x, command, H)
    unsure = np.diag([1e4] * 6)
    for k, estimate in enumerate(
        (
            Estimate(H, later, status=Status.LOST),
            Estimate(2 * H, later, unsure),
            Estimate(3 * H, np.full(6, np.nan)),
        ),
        1,
    ):
        answer = safe.step(k * H, estimate, command)
        assert answer.announced
        assert answer.flown == "stored plan"
        assert np.isfinite(answer.u).all()
    back = safe.step(4 * H, Estimate(4 * H, later), command)
    assert back.flown == "proposed"
    assert not back.announced


def test_a_vehicle_that_has_left_its_bound_is_announced_if_nothing_can_be_certified_from_there() -> None:
    task = across()
    safe, x = filter_of(task), at_rest((*task.start[:2], task.start[2] + 300.0))
    safe.step(0.0, Estimate(0.0, x), np.zeros(3))
    sideways = safe.step(H, Estimate(H, x + 200.0 * np.eye(6)[0]), np.zeros(3))
    assert sideways.breach
    assert sideways.flown == "proposed"  # certified from there
    assert safe.guarantee.state is GuaranteeState.HELD
    low = at_rest((*task.start[:2], task.start[2] - 140.0))  # below h_min
    answer = safe.step(2 * H, Estimate(2 * H, low), np.zeros(3))
    assert answer.breach
    assert safe.guarantee.state is GuaranteeState.LOST


def test_ground_that_turns_out_to_be_higher_is_taken_in() -> None:
    task = across()
    safe, x = filter_of(task), at_rest((*task.start[:2], task.start[2] + 300.0))
    before = safe.step(0.0, Estimate(0.0, x), np.zeros(3)).margin
    z = task.terrain.z.copy()
    z[:20, :20] += 150.0
    safe.updated_with([Message(0.0, "map", TERRAIN, HeightField(z, task.terrain.spacing))])
    answer = safe.step(H, Estimate(H, x), np.zeros(3))
    assert answer.flown == "proposed"
    assert answer.margin == pytest.approx(before - 150.0)


def test_wrong_input_is_refused_and_a_command_that_is_not_finite_is_not_flown() -> None:
    task = across()
    safe, x = filter_of(task), at_rest(task.start)
    answer = safe.step(0.0, Estimate(0.0, x), np.array([np.nan, 0.0, 0.0]))
    assert answer.flown == "nearest"  # to none, which is certified
    assert not answer.announced
    for t, state, proposed, expected in (
        (H, x[:5], np.zeros(3), r"state has shape \(5,\); allowed: \(6,\)"),
        (H, x, np.zeros(4), r"command has shape \(4,\); allowed: \(3,\)"),
        (3.0 * H, x, np.zeros(3), r"t = 0\.05 s; allowed: 0\.0166"),
    ):
        with pytest.raises(ValueError, match=expected):
            safe.step(t, Estimate(t, state), proposed)
    with pytest.raises(ValueError, match=r"target = .*; allowed: a place on the map with z >= "):
        filter_of(FlightMission(task.terrain, task.start, (*task.target[:2], 10.0)))
    with pytest.raises(ValueError, match="candidates = -1"):
        filter_of(task, -1)
