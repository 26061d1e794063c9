"""Overview and top view show what happens, not the whole map around it."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.opengl import import_mujoco
from mathnavi.models.terrain.height_field import HeightField

import_mujoco()  # before what draws

from mathnavi.renders.scene.cameras import ASPECT  # noqa: E402
from mathnavi.renders.scene.elements import Camera, raised  # noqa: E402
from mathnavi.renders.scene.landscape import map_cameras, mission_cameras  # noqa: E402

WIDE = 30e3  # [m]: width of the map
GROUND = HeightField(np.zeros((31, 31)), WIDE / 30.0, "plain")
COURSE = np.array([1.0, 1.0, 0.0])


def along(begin: tuple[float, float], end: tuple[float, float]) -> Array:
    """Places (n, 3) [m] of a straight flight at 800 m."""
    return np.column_stack([np.linspace(a, b, 20) for a, b in zip((*begin, 800.0), (*end, 900.0), strict=True)])


def share(camera: Camera, places: Array) -> float:
    """The larger of the shares of a picture's width and height that places fill; more than 1 if one is outside."""
    azimuth, elevation = np.radians([camera.azimuth, camera.elevation])
    forward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    sideways = np.cross(forward, (0.0, 0.0, 1.0))
    sideways /= np.linalg.norm(sideways)
    upward = np.cross(sideways, forward)
    ahead = raised(places, 0.0, camera.tall) - (np.array(camera.target) - camera.distance * forward)
    tangent = np.tan(np.radians(camera.field_of_view) / 2.0)
    x, y = ahead @ sideways / (ahead @ forward) / tangent / ASPECT, ahead @ upward / (ahead @ forward) / tangent
    if max(np.abs(x).max(), np.abs(y).max()) > 1.0:
        return 2.0
    return 0.5 * float(max(np.ptp(x), np.ptp(y)))


@pytest.mark.parametrize("ends", [((3e3, 4e3), (11e3, 12e3)), ((25e3, 2e3), (28e3, 9e3))])
def test_a_short_flight_over_a_large_map_fills_the_picture(
    ends: tuple[tuple[float, float], tuple[float, float]],
) -> None:
    places = along(*ends)
    overview, top, whole = mission_cameras(GROUND, places, COURSE)
    assert [overview.shot, top.shot, whole.shot] == ["overview", "top", ""]
    assert 0.4 < share(overview, places) < 0.9
    assert 0.4 < share(top, places) < 0.9
    assert share(whole, places) < 0.4


def test_a_flight_across_the_map_has_views_of_all_of_it() -> None:
    places = along((1e3, 1e3), (28e3, 27e3))
    found, whole = mission_cameras(GROUND, places, COURSE), map_cameras(GROUND, COURSE)
    assert [(each.name, each.target, each.distance) for each in found] == [
        (each.name, each.target, each.distance) for each in whole
    ]


def test_a_flight_that_ends_where_it_began_has_a_view_of_its_surroundings() -> None:
    overview, *_ = mission_cameras(GROUND, along((5e3, 5e3), (5e3, 5e3)), COURSE)
    assert share(overview, np.array([[5e3 - 600.0, 5e3, 800.0], [5e3 + 600.0, 5e3, 800.0]])) < 1.0
