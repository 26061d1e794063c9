"""Curved spaces on paper: the globe on which an attitude draws its nose, and Poincare's disc.

S^3 is seen through the map of Hopf, p -> p e_1 p^*: where the nose of a body with the attitude p points to. Geodesics
of S^3 become circles of the globe. The hyperbolic plane is projected to the disc by (p_1, p_2) / (1 + p_0), its
geodesics are arcs of circles that meet the edge at right angles.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Circle
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array

Flags = NDArray[np.bool_]

LIT, SHADED, LINE = "#fbfcfd", "#c3ced9", "#8496a8"
_GRADIENT = LinearSegmentedColormap.from_list("globe", [LIT, "#e9eef3", SHADED])
_GRATICULE = 30.0  # [degrees] between the lines of a globe
_PAPER = 0.5  # distance between the geodesics drawn on the disc
_FARTHEST = 4.0  # distance from the middle up to which they are
_PIXELS = 400


class MapProjection(Protocol):
    """A space in the plane of a picture."""

    def project(self, p: Array) -> tuple[Array, Flags]:
        """(m, 2) where points (m, size) are, and (m,) whether they are on the near side."""
        ...

    def prepare(self, axes: Axes) -> None:
        """Draw what stands still."""
        ...


class Globe:
    """The sphere on which the nose e_1 of an attitude moves, seen along a line of sight."""

    def __init__(self, azimuth: float, elevation: float) -> None:
        """[degrees] of the line of sight, as MuJoCo's cameras have them."""
        a, e = math.radians(azimuth), math.radians(elevation)
        self._forward = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
        right = np.array([math.sin(a), -math.cos(a), 0.0])
        self._screen = np.stack([right, np.cross(right, self._forward)], axis=1)  # (3, 2)

    def project(self, p: Array) -> tuple[Array, Flags]:
        return self._seen(nose(p))

    def prepare(self, axes: Axes) -> None:
        side = np.linspace(-1.0, 1.0, _PIXELS)
        x, y = np.meshgrid(side, side)
        shade = np.clip(np.hypot(x + 0.35, y - 0.4) / 1.45, 0.0, 1.0)
        edge = Circle((0.0, 0.0), 1.0, fc="none", ec=LINE, lw=1.2, transform=axes.transData)
        picture = axes.imshow(shade, extent=(-1.0, 1.0, -1.0, 1.0), origin="lower", cmap=_GRADIENT, vmin=0.0, vmax=1.0)
        axes.add_patch(edge)
        picture.set_clip_path(edge)
        for line in _graticule():
            place, near = self._seen(line)
            for shown, opacity in ((~near, 0.18), (near, 0.55)):
                axes.plot(*np.where(shown[:, None], place, np.nan).T, color=LINE, lw=0.6, alpha=opacity)
        axes.set(xlim=(-1.04, 1.04), ylim=(-1.04, 1.04), aspect="equal")

    def _seen(self, points: Array) -> tuple[Array, Flags]:
        return points @ self._screen, points @ self._forward <= 0.0


class Disc:
    """Poincare's disc, as much as given points need."""

    def __init__(self, points: Array) -> None:
        """``points`` (m, 3) are to be in sight."""
        self._radius = min(1.2 * float(np.linalg.norm(_on_disc(points), axis=1).max()) + 0.02, 1.02)

    def project(self, p: Array) -> tuple[Array, Flags]:
        return _on_disc(p), np.ones(len(p), dtype=bool)

    def prepare(self, axes: Axes) -> None:
        axes.add_patch(Circle((0.0, 0.0), 1.0, fc=LIT, ec=LINE, lw=1.6))
        u = np.linspace(-7.0, 7.0, 241)
        for s in np.arange(-_FARTHEST, _FARTHEST + 0.5 * _PAPER, _PAPER):
            across = np.stack([np.cosh(s) * np.cosh(u), np.full_like(u, np.sinh(s)) * np.cosh(u), np.sinh(u)], axis=1)
            for line in (across, across[:, [0, 2, 1]]):
                axes.plot(*_on_disc(line).T, color=LINE, lw=0.6, alpha=0.55)
        axes.set(xlim=(-self._radius, self._radius), ylim=(-self._radius, self._radius), aspect="equal")


def nose(p: Array) -> Array:
    """Images (m, 3) of e_1 under unit quaternions (m, 4): the first column of ``models.quaternion``'s R.

    It adds up the squares instead, as the recorded pictures do: the two differ by rounding.
    """
    w, x, y, z = p.T
    return np.stack([w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=1)


def _on_disc(p: Array) -> Array:
    place: Array = p[:, 1:] / (1.0 + p[:, :1])
    return place


def _graticule() -> list[Array]:
    """Circles of latitude and of longitude (m, 3)."""
    turn, half = np.linspace(0.0, 2.0 * math.pi, 181), np.linspace(-0.5 * math.pi, 0.5 * math.pi, 91)
    latitudes = np.radians(np.arange(-90.0 + _GRATICULE, 90.0, _GRATICULE))
    longitudes = np.radians(np.arange(0.0, 360.0, _GRATICULE))
    around = [
        np.stack([math.cos(b) * np.cos(turn), math.cos(b) * np.sin(turn), np.full_like(turn, math.sin(b))], axis=1)
        for b in latitudes
    ]
    upright = [
        np.stack([np.cos(half) * math.cos(a), np.cos(half) * math.sin(a), np.sin(half)], axis=1) for a in longitudes
    ]
    return around + upright
