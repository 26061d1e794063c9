"""Measures, mutants and counts of the study ``hunt``."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.fields import plain
from mathnavi.interfaces.signals import Event
from mathnavi.models.aerial.dynamics import HULL_RADIUS
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.search.evaluation import Evaluator
from mathnavi.sim.search.space import drawn
from mathnavi.studies.flight import hunt as hunt_study
from mathnavi.studies.flight.guarantee_holes import ANNOUNCED, clearance_in_bounds, violations
from mathnavi.studies.flight.hunt import Hole
from mathnavi.studies.flight.hunt_spaces import FLEET, HOLES, HOSTILE, SAFE_FLIGHT, UPDATES, Hunt
from mathnavi.studies.framework.study import Setup

T = np.arange(0.0, 10.0, 0.1)


def outcome(heights: np.ndarray, *events: tuple[float, str], left: float | None = 5.0) -> Any:
    """A flight of which only heights [m] above flat ground, events and the deadline count; h_min is 20 m."""
    x = np.column_stack([np.full(len(T), 300.0), np.full(len(T), 300.0), heights, np.zeros((len(T), 3))])
    return SimpleNamespace(
        config={
            "scenario": "safe-flight",
            "terrain": {"path": "flat"},
            "fields": {"clearance_min": 20.0, "uncharted": ()},
        },
        summary={"clearance_margin_m": float(heights.min()) - 20.0, "deadline_left_s": left, "deadline_s": 40.0},
        recording=SimpleNamespace(t=T, truths={"vehicle": x}),
        events=[Event(t, "vehicle", kind, "") for t, kind in events],
    )


@pytest.fixture(autouse=True)
def flat(monkeypatch: pytest.MonkeyPatch) -> None:
    ground = SimpleNamespace(height=lambda x, y: np.zeros_like(x))
    monkeypatch.setattr("mathnavi.studies.flight.guarantee_holes._ground", lambda *_: ground)


SAFE = np.full(len(T), 30.0)
LOW = np.where(T < 5.0, 30.0, 15.0)  # from 5 s on


def test_a_flight_that_keeps_all_bounds_has_the_least_of_its_margins() -> None:
    found = violations(outcome(SAFE))
    assert (found["violated"], found["silently_violated"], found["violation"]) == (False, False, "")
    assert found["relative_margin"] == min(10.0 / 20.0, 5.0 / 40.0)


def test_a_violation_without_an_event_before_it_is_silent() -> None:
    found = violations(outcome(LOW, (6.0, "guarantee-lost")))
    assert (found["violated"], found["silently_violated"], found["violation"]) == (True, True, "clearance")
    assert found["violation_s"] == pytest.approx(5.0)
    assert found["relative_margin"] == -0.25


@pytest.mark.parametrize(
    ("events", "silent"),
    [
        ([(4.0, "guarantee-lost")], False),
        ([(3.0, "guarantee-lost"), (4.0, "guarantee-held")], True),
        ([(3.0, "guarantee-lost"), (4.0, "guarantee-held"), (4.5, "guarantee-lost")], False),
        ([(5.0, "guarantee-endangered")], False),  # at the same instant
        ([(1.0, "guarantee-endangered"), (2.0, "guarantee-held")], True),
        ([(0.0, "guarantee-not-yet")], False),
        ([(1.0, "tracking-breach")], True),  # says nothing of the guarantee
        ([(4.0, "low-clearance")], True),  # a plan that is refused announces nothing
        ([(4.0, "deadline-lost")], True),
    ],
)
def test_a_loss_is_announced_until_the_guarantee_is_regained(events: list[tuple[float, str]], silent: bool) -> None:
    found = violations(outcome(LOW, *events))
    assert found["silently_violated"] is silent
    assert (found["relative_margin"] == ANNOUNCED) is not silent


@pytest.mark.parametrize(("event", "silent"), [("deadline-moved", False), ("tracking-breach", True)])
def test_a_missed_deadline_is_announced_by_events_on_deadlines(event: str, silent: bool) -> None:
    found = violations(outcome(SAFE, (9.0, event), left=-1.0))
    assert (found["violated"], found["silently_violated"]) == (True, silent)


@pytest.mark.parametrize(("known", "heights", "silent"), [(9.0, SAFE, False), (1.0, SAFE, True), (9.0, LOW, True)])
def test_a_hill_that_no_map_shows_yet_cannot_be_announced(known: float, heights: np.ndarray, silent: bool) -> None:
    made = outcome(heights, (6.0, "ground-contact"))
    made.config["fields"] |= {"uncharted": ((1.0, 2.0, 3.0, 4.0),), "uncharted_time": known}
    assert violations(made)["silently_violated"] is silent


def test_a_contact_is_a_violation_wherever_it_happens() -> None:
    found = violations(outcome(SAFE, (2.0, "ground-contact")))
    assert (found["silently_violated"], found["violation_s"], found["relative_margin"]) == (True, 2.0, -1.0)


@pytest.mark.parametrize(
    ("searches", "draws", "product", "median", "mean", "shown"),
    [
        ((40, 90), (400, None), (None,), 65.0, 1400.0, True),
        ((40, 90, None), (None, None), (None,), 90.0, math.inf, True),
        ((40, None, None), (None, None), (None,), math.inf, math.inf, False),
        ((40, 90), (30, 100), (None,), 65.0, 65.0, False),
        ((40, 50), (30, 100), (None,), 45.0, 65.0, True),
        ((200,), (None,), (None,), 200.0, math.inf, False),
        ((40, 90), (400, None), (None, 7), 65.0, 1400.0, False),
    ],
)
def test_power_is_a_find_in_time_and_sooner_than_by_draws_and_none_in_the_product(
    searches: tuple[int | None, ...],
    draws: tuple[int | None, ...],
    product: tuple[int | None, ...],
    median: float,
    mean: float,
    shown: bool,
) -> None:
    hole = Hole("hole", searches, draws, 1000, product)
    assert (hole.median, hole.mean_draws, hole.shown) == (median, mean, shown)


def test_samplers_are_compared_by_the_median_of_their_searches() -> None:
    hole = Hole("hole", (40, 90, None), (400,), 1000, (None,), {"cmaes": (None, None, 7)})
    assert [list(row) for row in hunt_study._sampler_table([hole]).rows] == [
        ["hole", "sobol-cmaes", "40, 90, not found", "90"],
        ["hole", "cmaes", "not found, not found, 7", "inf"],
    ]


def test_a_search_takes_results_of_another_environment_when_the_study_does(monkeypatch: pytest.MonkeyPatch) -> None:
    searches: list[Evaluator] = []

    def directed(evaluator: Evaluator, *_: Any, **__: Any) -> list[Any]:
        searches.append(evaluator)
        return [SimpleNamespace(ending="flown")]

    monkeypatch.setattr(hunt_study, "directed", directed)
    nothing: Any = None
    for mixed in (False, True):
        setup = Setup(None, nothing, mix_environments=mixed)
        hunt_study._searched(setup, nothing, FLEET, hunt_study.MARGIN, 1)
        assert searches[-1].mix_environments is mixed
        assert searches[-1].elsewhere is setup.elsewhere  # so that they are counted


def test_clearance_counts_in_tracking_bounds() -> None:
    flown: Any = SimpleNamespace(
        config={"mission": {"tracking_bound": {"vertical": 4.0}}}, summary={"clearance_margin_m": -1.0}
    )
    assert clearance_in_bounds(flown) == {"clearance_in_bounds": -0.25}


def at(share: float, hunt: Hunt) -> dict[str, Any]:
    """The fields of a mission at a share of every range."""
    return plain(hunt.make(drawn(hunt.space, [share] * len(hunt.space))).spec.config)


@pytest.mark.parametrize("hunt", HOSTILE[-3:], ids=lambda hunt: hunt.name)
def test_missions_of_fleets_of_the_quadrotor_and_of_episodes_are_flown_and_measured(hunt: Hunt) -> None:
    begun = replace(hunt.make(drawn(hunt.space, [0.5] * len(hunt.space))).build(), duration=1.0)
    assert not violations(begun.run())["silently_violated"]


@pytest.mark.parametrize("hunt", [SAFE_FLIGHT, UPDATES], ids=lambda hunt: hunt.name)
def test_ends_lie_on_either_side_of_the_middle(hunt: Hunt) -> None:
    fields = at(0.5, hunt)
    (x, y, z), (to_x, to_y, _) = fields["start"], fields["target"]
    ground = load_terrain(fields["terrain"])
    assert (0.5 * (x + to_x), 0.5 * (y + to_y)) == pytest.approx((320.0, 320.0))
    assert math.hypot(to_x - x, to_y - y) == pytest.approx(150.0)
    bound = hunt.make(drawn(hunt.space, [0.5] * len(hunt.space))).build().config["mission"]["tracking_bound"]
    certified = ground.inflated(bound["horizontal"] + HULL_RADIUS, bound["vertical"])
    lowest = float(certified.height(x, y)) + fields["clearance_min"]
    assert z - lowest == pytest.approx(40.0, abs=0.01)


def test_the_mutant_with_half_the_bound_begins_as_low_as_it_certifies() -> None:
    """And the product as low as it does, with the whole bound."""
    holed = HOLES[-1]
    low = [0.5] * 5 + [0.0] + [0.5] * (len(holed.mutant.space) - 6)
    for hunt in (holed.mutant, holed.product):
        mission = hunt.make(drawn(hunt.space, low)).build().config["mission"]
        height = mission["start"][2] - float(load_terrain("plain").z.max()) - mission["clearance_min"]
        assert height == pytest.approx(mission["tracking_bound"]["vertical"], abs=0.01)
