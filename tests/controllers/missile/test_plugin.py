"""The plug-in: its configuration, what it refuses, and its message when there is no compiler."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from mathnavi.controllers.missile.plugin import MissileConfig, MissileController
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.interfaces.signals import Estimate, PlanRequest
from mathnavi.models.missile.coordinates import SPATIAL
from tests.controllers.missile.flights import built, first_plan, mission


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"autopilot": "pid"}, "autopilot = 'pid'; allowed: feedback-linearisation, tvlqr, open-loop"),
        ({"backend": "snopt"}, "backend = 'snopt'; allowed: auto, fatrop"),
        ({"grid": "even"}, "grid = 'even'; allowed: uniform, arclength"),
        ({"spatial": "roll"}, "spatial = 'roll'; allowed: pitch-and-yaw, joint"),
        ({"nodes": 3}, "nodes = 3; allowed: 4 to 200"),
        ({"nodes": 201}, "nodes = 201; allowed: 4 to 200"),
        ({"reserve": 1.0}, "reserve = 1.0; allowed: 0 <= reserve < 1"),
        ({"commit": 0.0}, "commit = 0.0; allowed: a finite value > 0"),
    ],
)
def test_what_makes_no_sense_is_refused_with_what_is_allowed(fields: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        MissileConfig(**fields)


def test_a_bandwidth_too_fast_for_the_ticks_is_refused() -> None:
    with pytest.raises(ValueError, match=r"bandwidth = 60\.0; allowed: at most 50 rad/s at a control_rate of 250 Hz"):
        built(mission(), bandwidth=60.0)


@pytest.mark.parametrize(("wanted", "period"), [(0.1, 0.1), (0.0301, 0.032), (1e-6, 0.004), (600.0, 600.0)])
def test_the_period_is_a_whole_number_of_control_periods(wanted: float, period: float) -> None:
    planner, autopilot = built(mission(), replan_period=wanted)
    assert planner.period == pytest.approx(period)
    assert autopilot.period == 0.004


def test_without_a_compiler_the_first_plan_says_so_and_is_the_same(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    guidance = mission()
    wanted = first_plan(guidance, backend="fatrop")
    monkeypatch.setenv("PATH", str(tmp_path))
    planner, _ = MissileController.build(MissileConfig(), guidance)
    plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, guidance.start_state), None))
    assert plan.ok
    assert plan.notes == ("backend",)
    assert "no C compiler named cc" in plan.message
    assert plan.cost == pytest.approx(wanted.cost)


def test_a_compiler_that_fails_is_quoted_and_done_without(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\necho 'cc: out of order' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    transcription.cache_clear()  # or what was compiled before is at hand
    guidance = mission()
    planner, _ = MissileController.build(MissileConfig(), guidance)
    plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, guidance.start_state), None))
    assert plan.ok
    assert "cc: out of order" in plan.message
    with pytest.raises(OSError, match="cc: out of order"):
        MissileController.build(MissileConfig(backend="fatrop-compiled"), guidance)


@pytest.mark.parametrize("spatial", ["pitch-and-yaw", "joint"])
def test_both_ways_through_space_plan_the_same_flight(spatial: str) -> None:
    guidance = mission(SPATIAL)
    plan = first_plan(guidance, spatial=spatial)
    assert plan.cost == pytest.approx(first_plan(mission()).cost, rel=1e-3)


def test_a_share_of_the_limits_is_left_to_the_autopilot() -> None:
    tight = mission(input_max=(3e3, 8e3, 150.0))
    kept = abs(first_plan(tight, reserve=0.2).u).max(axis=0)
    assert (kept <= [2401.0, 6401.0, 120.1]).all()
    assert kept[1] == pytest.approx(6400.0, rel=1e-3)
