"""Cameras of scenes: one that has what it frames in its picture, and one behind a vehicle."""

from __future__ import annotations

from mathnavi.renders.framing import framing
from mathnavi.renders.scene.elements import Camera, Framed, raised

ASPECT = 1.5  # width over height of the picture in the browser, more or less


def framing_camera(
    name: str,
    framed: Framed,
    sight: tuple[float, float],
    field_of_view: float,
    *,
    aspect: float = ASPECT,
    low: float = 0.0,
    tall: float = 1.0,
) -> Camera:
    """A camera along a line of sight (azimuth, elevation) [degrees], with a vertical field of view [degrees].

    Heights above ``low`` [m] are multiplied by ``tall``.
    """
    points = raised(framed.points, low, tall)
    view = framing(points, framed.box, field_of_view, aspect, sight)
    place = (float(view.lookat[0]), float(view.lookat[1]), float(view.lookat[2]))
    return Camera(name, place, view.distance, *sight, field_of_view=field_of_view, tall=tall, framed=framed)


def chase(name: str, motion: str, distance: float, behind: float, span: float, elevation: float = -17.0) -> Camera:
    """A camera behind a vehicle."""
    return Camera(name, (0.0, 0.0, 0.0), distance, 0.0, elevation, motion, behind, 45.0, span=span)
