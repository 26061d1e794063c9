"""The scenario of the robot that localises itself, within the map of a building."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.ranging.pose_certificate import PoseCertificate, PoseCertificateConfig
from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig, WallFields
from tests.models.field.walls import FURNISHED

BEAMS = (-135.0, -45.0, 45.0, 135.0)


@pytest.fixture
def room(tmp_path: Path) -> str:
    path = tmp_path / "room.json"
    path.write_text(json.dumps({"name": FURNISHED.name, "rings": FURNISHED.rings}))
    return str(path)


def flown(room: str, estimator: str, **fields: Any) -> Any:
    given = {"field.shape": "map", "field.map": room, "sensors": BEAMS, "duration": 1.5, "start_known": True}
    return mn.run("range-localisation", seed=3, estimator=estimator, **{**given, **fields})


@pytest.mark.parametrize("estimator", ["feasible_set_bank", "range_ekf", "range_iekf", "range_ukf", "range_particle"])
def test_estimators_follow_a_robot_among_tables(room: str, estimator: str) -> None:
    summary = flown(room, estimator).summary
    assert not summary["touched_wall"]
    assert summary["position_rms_m"] < 0.15


def test_the_observer_says_that_its_theorem_needs_a_smooth_wall(room: str) -> None:
    with pytest.raises(MissionError, match=r"furnished room is a polygon, and range_observer needs a smooth wall"):
        flown(room, "range_observer")


def test_a_map_and_its_shape_come_together(room: str) -> None:
    with pytest.raises(FieldError, match=re.escape("allowed: none with shape = ellipse")):
        WallFields(map=room)
    with pytest.raises(FieldError, match=re.escape("field.map = ''; allowed: a file or a folder")):
        WallFields(shape="map")
    assert RangeLocalisationConfig(field=WallFields(shape="map", map=room)).field.curve().rings == FURNISHED.rings


def test_a_ray_beyond_the_maximum_range_has_no_echo(room: str) -> None:
    run = flown(room, "range_ekf", **{"noise.range_maximum": 1.5})
    ranges = run.arrays["measurement.ranges"] if hasattr(run, "arrays") else run.log.arrays["measurement.ranges"]
    assert np.isnan(ranges).any()
    assert np.nanmax(ranges) < 1.5


def test_a_pose_among_tables_is_certified() -> None:
    mission = RangingMission(
        FURNISHED, tuple(np.radians(BEAMS)), RangeQuality(absolute=0.01), OdometryQuality(noise=(0.01, 0.01))
    )
    certificate = PoseCertificate(PoseCertificateConfig(readings=12, spacing=0.1), mission)
    x, u = np.array([2.8, 0.6, 0.4]), np.array([0.6, 0.5])
    for k in range(12):
        certificate.note(0.1 * k, FURNISHED.ranges(x, mission.alpha)[0], u)
        last, x = x, mission.flow(x, u, 0.1)
    assert certificate.check(last).certified
    away = certificate.check(last + np.array([0.8, 0.5, 0.0]))
    assert not away.certified
    if away.complete:
        assert min(np.linalg.norm(other[:2] - last[:2]) for other in away.others) < 0.1
