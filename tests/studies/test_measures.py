"""Measures of the studies beside the summary, on flights made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.signals import OPTIMISED, Plan
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.studies.flight import as_printed, cost_to_go, run_time, threat
from mathnavi.studies.framework import study

SPIKE = HeightField(np.pad([[400.0]], 10), 100.0, "spike")  # in the middle of 2 km of plain


def outcome(x: Any, t: Any, plans: Any = (), **mission: Any) -> Any:
    recording = SimpleNamespace(
        t=np.asarray(t, float),
        truths={"vehicle": np.asarray(x, float)},
        agents={"vehicle": SimpleNamespace(plans=plans)},
    )
    return SimpleNamespace(recording=recording, config={"terrain": {"path": "spike"}, "mission": mission})


@pytest.fixture(autouse=True)
def on_the_spike(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (study, as_printed):
        monkeypatch.setattr(module, "load_terrain", lambda path: SPIKE)


def test_an_arc_between_two_clear_nodes_is_found_to_dip() -> None:
    """Level flight at 300 m over a spike of 400 m: the ends are 300 m above the plain, the middle is under ground."""
    x = np.array([[500.0, 1000.0, 300.0, 100.0, 0.0, 0.0], [1500.0, 1000.0, 300.0, 100.0, 0.0, 0.0]])
    plan = Plan(np.array([0.0, 10.0]), x, np.zeros((1, 3)), np.array([OPTIMISED]))
    found = as_printed.arcs(outcome(x, [0.0, 10.0], [(0.0, plan)], clearance_min=50.0))
    assert found == {"arcs": 1, "arcs_dipping": 1, "arcs_under_ground": 1, "deepest_m": pytest.approx(150.0)}


def test_an_arc_whose_end_is_too_low_is_not_the_nodes_fault() -> None:
    x = np.array([[500.0, 1000.0, 40.0, 100.0, 0.0, 0.0], [1500.0, 1000.0, 40.0, 100.0, 0.0, 0.0]])
    plan = Plan(np.array([0.0, 10.0]), x, np.zeros((1, 3)), np.array([OPTIMISED]))
    found = as_printed.arcs(outcome(x, [0.0, 10.0], [(0.0, plan)], clearance_min=50.0))
    assert (found["arcs"], found["arcs_dipping"]) == (1, 0)


def test_the_spacing_of_nodes_counts_the_jumps() -> None:
    t = np.arange(0.0, 10.01, 0.5)
    x = np.zeros((len(t), 6))
    x[:, 0] = 100.0 * t
    x[t >= 6.0, 1] = 500.0
    flight = outcome(x, t)
    flight.config["controller"] = {"fields": {"nodes": 6, "horizon": 10.0}}
    assert study.node_spacing(flight)["node_spacing_m"] == pytest.approx(np.hypot(200.0, 500.0))


def test_the_height_near_a_radar_is_that_within_its_surroundings() -> None:
    x = np.zeros((3, 6))
    x[:, 0], x[:, 1], x[:, 2] = (100.0, 1900.0, 1800.0), 200.0, (900.0, 300.0, 500.0)
    radar = {"x": 1900.0, "y": 200.0, "radius": 100.0}
    assert threat.near_radar(outcome(x, [0, 1, 2], radars=[radar]))["near_height_m"] == pytest.approx(400.0)
    far = {"x": 1000.0, "y": 1900.0, "radius": 100.0}
    assert threat.near_radar(outcome(x, [0, 1, 2], radars=[far]))["near_height_m"] is None


@pytest.mark.parametrize(
    ("cell", "area"),
    [
        ({"h_s": 1e-4, "spacing_m": 1.0, "cost": 1.0}, "D"),
        ({"h_s": 5.0, "spacing_m": 800.0, "cost": 1.0}, "A"),
        ({"h_s": 2.0, "spacing_m": 600.0, "cost": 9.0}, "B"),
        ({"h_s": 2.0, "spacing_m": 600.0, "cost": 7.0}, "C"),
    ],
)
def test_each_pair_of_nodes_and_horizon_falls_into_its_area(cell: dict[str, float], area: str) -> None:
    assert run_time._area({"mean_ms": 1.0, **cell}, [{"cost": 8.0}]) == area


def test_the_graphs_metric_is_never_short_and_ten_percent_long_at_most_across_the_map() -> None:
    error = cost_to_go.metric_error(HeightField(np.zeros((2, 2)), 82_000.0, "print"))
    assert error.min() >= -1e-9
    assert np.median(error) < 0.1


def test_falling_means_each_less_than_the_one_before() -> None:
    assert study.falls([3.0, 2.0, 1.0])
    assert not study.falls([3.0, 3.0, 1.0])
    assert not study.falls([1.0, 2.0])
