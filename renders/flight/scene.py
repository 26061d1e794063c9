"""A run drawn by MuJoCo: the ground, the airframe, the path flown, the plan ahead, radars, start and target.

Vehicle, lines and beacons are drawn at a size in pixels, over the two worlds of ``mathnavi.renders.landscape``.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.renders.flight.run_data import FlightRun, plan_arcs, trail
from mathnavi.renders.landscape import (
    AIRFRAME,
    OPTICS,
    TALL_WORLD,
    TRUE_WORLD,
    Airframe,
    Landscape,
    add_airframe,
    add_domes,
    landscape,
    place_domes,
)
from mathnavi.renders.overlay import Label
from mathnavi.renders.palette import COLOURS, Picture, SceneElement, part_of
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.renders.stage import Optics, Stage, Staged, View

CHASE = Optics(45.0, 2e-4, 5.0)
PIN = 34.0  # [pixels] at a picture 720 pixels high: height of the pins at start and target
_ANGLE, _RISE = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False), np.radians([15.0, 30.0, 50.0, 75.0]))
# (192, 3) points on the upper half of the unit sphere
DOME = np.stack([np.cos(_ANGLE) * np.cos(_RISE), np.sin(_ANGLE) * np.cos(_RISE), np.sin(_RISE)], -1).reshape(-1, 3)


class FlightScene(Staged):
    """Scene as a context manager, see ``Staged``."""

    def __init__(self, run: FlightRun, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        self.run = run
        self._land = Landscape(run.terrain)
        self.model = _model(run, width, height, samples)
        self._airframe = Airframe(self.model, "airframe")
        self._chase = ChaseCamera(run, AFAR)
        self.stage = Stage(self.model, width, height, glow=0.75)

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]; ``turn`` [degrees] turns the overview around the map."""
        view = self._chase.view(t) if camera == "chase" else self._map_view(camera, turn)
        optics = CHASE if camera == "chase" else OPTICS[camera]
        self.stage.look(view, optics, (TRUE_WORLD if camera == "chase" else TALL_WORLD, AIRFRAME))
        self._place_airframe(t, camera, view)
        self.stage.begin(fog=camera == "chase")
        self._add_lines(t, camera)
        self._add_beacons(t, camera)
        return self.stage.end(sky=camera == "chase")

    def world(self, points: Array, camera: str) -> Array:
        """(..., 3) map points [m] where the camera's world shows them."""
        return np.array(points, dtype=np.float64) if camera == "chase" else self._land.tall(points)

    def pixels(self, points: Array, camera: str) -> Array:
        """(n, 3) column, row and depth [m] of map points (n, 3) in the picture drawn last; depth <= 0 is behind."""
        return self.stage.pixels(self.world(points, camera))

    def labels(self, t: float, camera: str) -> list[Label]:
        """Names of what is in sight of the picture drawn last: start, target, radars that are on."""
        run = self.run
        lift = PIN * self.stage.unit
        found = []
        eye, _, _ = self.stage.eye()
        for part, place in ((SceneElement.START, run.mission.start), (SceneElement.TARGET, run.mission.target_at(t))):
            if camera == "chase" and not run.terrain.line_of_sight(eye, place):
                continue
            pin = np.array([0.0, 0.0, lift * float(self.stage.metres_per_pixel(self.world(place[None], camera))[0])])
            top = place + pin / (1.0 if camera == "chase" else EXAGGERATION)
            found.append((part.value, self.stage.inside(self.world(top[None], camera))))
        for number, track in enumerate(run.mission.radars, start=1):
            radar = track.at(t, run.terrain)
            if radar is not None:
                centre = np.array([radar.x, radar.y, float(run.terrain.height(radar.x, radar.y))])
                # Beside the vehicle only a part of the dome is in the picture.
                points = centre + (radar.radius * DOME if camera == "chase" else np.zeros((1, 3)))
                name = (
                    SceneElement.RADAR.value if len(run.mission.radars) == 1 else f"{SceneElement.RADAR.value} {number}"
                )
                found.append((name, self.stage.inside(self.world(points, camera))))
        return [Label(name, *pixels.mean(axis=0).tolist()) for name, pixels in found if len(pixels)]

    # ---- cameras

    def _map_view(self, camera: str, turn: float) -> View:
        """The view from which the whole map fills the picture."""
        course = self.run.mission.target - self.run.mission.start
        return self._land.view(camera, course, turn, self.stage.width / self.stage.height)

    # ---- what is drawn

    def _place_airframe(self, t: float, camera: str, view: View) -> None:
        near = camera == "chase"
        x = self.run.state(t)
        # From afar it is drawn level: tilted, it could turn its edge to the camera and be lost to sight.
        u = self.run.u[min(self.run.index(t), len(self.run.u) - 1)] if near else np.zeros(3)
        position, quaternion = airframe_pose(x[:3], x[3:], u)
        position = self.world(position, camera)
        span = 0.16 if near else 0.055  # of the picture's height
        size = span * 2.0 * (AFAR.distance if near else view.distance) * self.stage.tangent()
        if near:
            self._airframe.place(self.stage, position, quaternion, size)
        else:
            self._airframe.place_afar(self.stage, position, quaternion, size, view.eye)
        opacity = 0.16 if near else 0.24  # the chase camera often looks from inside
        place_domes(self.model, self.run.terrain, self.run.mission.radars, t, opacity)

    def _add_lines(self, t: float, camera: str) -> None:
        width = 4.0 if camera == "chase" else 3.4  # [pixels] at a picture 720 pixels high
        for part, points in self._lines(t, camera):
            self.stage.line(self.world(points, camera), COLOURS[part], width, dashed=part is SceneElement.COMPLETION)
        x = self.run.state(t)
        # A plumb line shows where over the ground the vehicle is.
        if camera != "chase" and self.run.terrain.contains(x[0], x[1]):
            foot = np.array([x[0], x[1], float(self.run.terrain.height(x[0], x[1]))])
            self.stage.line(self.world(np.array([foot, x[:3]]), camera), COLOURS[SceneElement.FLOWN], 2.0)

    def _lines(self, t: float, camera: str) -> Iterator[tuple[SceneElement, Array]]:
        run = self.run
        if run.index(t) > 0:
            total = max(float(run.travelled[-1]), 1.0)
            yield (
                SceneElement.FLOWN,
                trail(run, t, *((60.0, total / 150.0) if camera == "chase" else 2 * (total / 260.0,))),
            )
        plan = run.plan(t)
        if plan is not None and t < run.duration:  # at the end nothing is ahead
            for part, arcs in groupby(plan_arcs(plan, t, step=0.6), lambda arc: part_of(arc[0])):
                yield part, np.vstack([points for _, points in arcs])

    def _add_beacons(self, t: float, camera: str) -> None:
        for part, place in (
            (SceneElement.START, self.run.mission.start),
            (SceneElement.TARGET, self.run.mission.target_at(t)),
        ):
            ground = np.array([place[0], place[1], float(self.run.terrain.height(place[0], place[1]))])
            foot, top = self.world(np.array([ground, place]), camera)
            self.stage.pin(foot, top, PIN, COLOURS[part])


@dataclass(frozen=True)
class Following:
    """Parameters of a camera that follows a vehicle."""

    distance: float  # [m] behind it
    step: float  # [s] between the precomputed places
    smoothing: float  # [s] standard deviation of the Gaussian that steadies the camera
    clear: float  # [m] over the ground between itself and the vehicle, at least
    rise: float = 0.36  # over the vehicle, in distances
    ahead: float = 0.55  # distance of the point of aim in front of the vehicle, in distances


AFAR = Following(1300.0, 0.25, 2.5, 110.0)


class ChaseCamera:
    """Behind and above the vehicle, on a smoothed path that stays clear of the ground."""

    def __init__(self, run: FlightRun, how: Following) -> None:
        self.t = np.arange(0.0, run.duration + how.step, how.step)
        position = np.array([run.state(float(t))[:3] for t in self.t])
        sigma = how.smoothing / how.step
        course = run.mission.target[:2] - run.mission.start[:2]
        # Where the vehicle hovers the course to the target stands in for a direction of flight.
        rate = np.gradient(position[:, :2], how.step, axis=0) + course / max(float(np.linalg.norm(course)), 1.0)
        rate = gaussian_filter1d(rate, 1.6 * sigma, axis=0, mode="nearest")
        heading = rate / np.maximum(np.linalg.norm(rate, axis=1, keepdims=True), 1e-9)
        climb = gaussian_filter1d(position[:, 2], sigma, mode="nearest")
        back = position[:, :2] - how.distance * heading
        # The camera clears the highest ground between itself and the vehicle, known a little in advance.
        line = np.linspace(0.0, 1.0, 9)[:, None, None]
        east, north = np.moveaxis(back + line * (position[:, :2] - back), -1, 0)
        ground = run.terrain.height(np.clip(east, 0.0, run.terrain.width), np.clip(north, 0.0, run.terrain.depth))
        least = maximum_filter1d(np.max(ground, axis=0) + how.clear, round(2.0 * sigma) | 1, mode="nearest")
        height = gaussian_filter1d(np.maximum(climb + how.rise * how.distance, least), 0.7 * sigma, mode="nearest")
        self.eye = np.column_stack([back, height])
        ahead = how.ahead * how.distance * heading
        self.lookat = np.column_stack(
            [position[:, :2] + ahead, gaussian_filter1d(position[:, 2], 0.2 * sigma, mode="nearest")]
        )

    def view(self, t: float) -> View:
        eye, lookat = (
            np.array([np.interp(t, self.t, path[:, k]) for k in range(3)]) for path in (self.eye, self.lookat)
        )
        return View.between(eye, lookat)


# ---- the model


def _model(run: FlightRun, width: int, height: int, samples: int) -> Any:
    spec = landscape(run.terrain, width, height, samples)
    add_domes(spec, run.terrain, run.mission.radars)
    add_airframe(spec, "airframe")
    return spec.compile()
