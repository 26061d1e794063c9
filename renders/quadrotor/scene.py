"""Scene of a quadrotor's flight, drawn by MuJoCo: next to the vehicle at its true size, and the whole canyon from
above.

The world is the true one, heights and all. In the chase view the vehicle is the model that flew, in its attitude, its
rotors turning far more slowly than they do; from afar an airframe stands for it that can be seen.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.models.quadrotor.dynamics import ROTORS
from mathnavi.models.quadrotor.entity import add_vehicle
from mathnavi.renders.flight.run_data import plan_arcs
from mathnavi.renders.flight.scene import ChaseCamera, Following
from mathnavi.renders.framing import Box, framing
from mathnavi.renders.landscape import AIRFRAME, OPTICS, TRUE_WORLD, Airframe, add_airframe, landscape
from mathnavi.renders.overlay import Label
from mathnavi.renders.palette import COLOURS, Picture, SceneElement, part_of
from mathnavi.renders.quadrotor.inset import Inset
from mathnavi.renders.quadrotor.run_data import QuadrotorRun
from mathnavi.renders.stage import Optics, Stage, Staged, View

CHASE = Optics(50.0, 2e-4, 5.0)
NEAR = Following(distance=2.4, step=0.1, smoothing=0.6, clear=1.2, rise=0.42, ahead=0.7)
VEHICLE, NEAR_GROUP = "vehicle", 4
DRAWN = 2  # the group of the vehicle's geoms that are to be seen
SPIN = 23.0  # [rad/s] at which rotors are drawn to turn
SIGHT = {"overview": (72.0, -52.0), "top": (90.0, -89.9)}  # [degrees] azimuth and elevation
FREE = {"overview": Box(0.02, 0.98, 0.06, 0.98), "top": Box(0.03, 0.97, 0.03, 0.97)}  # of the picture, for the map
SPAN = 0.07  # of the picture's height: the airframe from afar
WIDTH = {"chase": 3.4, "overview": 3.2, "top": 3.4}  # [pixels] of lines, at a picture 720 pixels high
PIN = 34.0  # [pixels] likewise: height of the pins at start and target
TRAIL, BEHIND = 2.0, 14.0  # [m] between points of the trail from afar; length that is drawn finely beside the vehicle
_UP = np.array([0.0, 0.0, 1.0])
LOW = 0.16  # [m] under the vehicle's centre the trail is drawn beside it, not through it


class QuadrotorScene(Staged):
    """Scene as a context manager, see ``Staged``."""

    def __init__(self, run: QuadrotorRun, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        self.run = run
        self.model: Any = _model(run, width, height, samples)
        self._afar = Airframe(self.model, "afar")
        self._chase = ChaseCamera(run.flight, NEAR)
        self._blades = [int(self.model.geom(f"{VEHICLE}/blade_{rotor}").id) for rotor in ROTORS]
        self._inset = Inset(run, height)
        self._aspect = width / height
        self.stage = Stage(self.model, width, height, glow=0.75)

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]; ``turn`` [degrees] turns the overview around the map."""
        near = camera == "chase"
        view = self._chase.view(t) if near else self._map_view(camera, turn)
        self.stage.look(view, CHASE if near else OPTICS[camera], (TRUE_WORLD, NEAR_GROUP if near else AIRFRAME))
        self._place(t, near, view)
        self.stage.begin(fog=near)
        for part, points in self._lines(t, near):
            self.stage.line(points, COLOURS[part], WIDTH[camera], dashed=part is SceneElement.COMPLETION)
        for part, place in (
            (SceneElement.START, self.run.flight.mission.start),
            (SceneElement.TARGET, self.run.flight.mission.target),
        ):
            self.stage.pin(self._foot(place), place, PIN, COLOURS[part])
        picture = self.stage.end(sky=near)
        return self._inset.put(picture, t) if near else picture

    def pixels(self, points: Array, camera: str) -> Array:
        """(n, 3) column, row and depth [m] of map points (n, 3) in the picture drawn last; depth <= 0 is behind."""
        return self.stage.pixels(points)

    def labels(self, t: float, camera: str) -> list[Label]:
        """Names of start and target, where they are in sight of the picture drawn last."""
        found = []
        eye, _, _ = self.stage.eye()
        flight = self.run.flight
        for part, place in ((SceneElement.START, flight.mission.start), (SceneElement.TARGET, flight.mission.target)):
            if camera == "chase" and not flight.terrain.line_of_sight(eye, place):
                continue
            up = PIN * self.stage.unit * float(self.stage.metres_per_pixel(place[None])[0])
            found += [Label(part.value, *pixel) for pixel in self.stage.inside((place + up * _UP)[None]).tolist()]
        return found

    # ---- cameras

    def _map_view(self, camera: str, turn: float) -> View:
        """The view that the whole map fills."""
        terrain = self.run.flight.terrain
        heights = (float(terrain.z.min()), float(terrain.z.max()))
        corners = np.array([[x, y, z] for x in (0.0, terrain.width) for y in (0.0, terrain.depth) for z in heights])
        azimuth, elevation = SIGHT[camera]
        sight = (azimuth + turn * (camera == "overview"), elevation)
        return framing(corners, FREE[camera], OPTICS[camera], self._aspect, sight)

    # ---- what is drawn

    def _place(self, t: float, near: bool, view: View) -> None:
        position, quaternion = self.run.pose(t)
        joint = int(self.model.joint(f"{VEHICLE}/pose").qposadr[0])
        self.stage.data.qpos[joint : joint + 7] = *position, *quaternion
        for k, blade in enumerate(self._blades):
            half = 0.5 * ((1.0 if k % 2 else -1.0) * SPIN * t + 1.7 * k)
            self.model.geom_quat[blade] = math.cos(half), 0.0, 0.0, math.sin(half)
        if not near:
            x = self.run.flight.state(t)
            # Drawn level: tilted, it could turn its edge to the camera and be lost to sight.
            _, level = airframe_pose(x[:3], x[3:], np.zeros(3))
            span = SPAN * 2.0 * float(np.linalg.norm(view.eye - position)) * self.stage.tangent()
            self._afar.place_afar(self.stage, position, level, span, view.eye)

    def _lines(self, t: float, near: bool) -> Iterator[tuple[SceneElement, Array]]:
        """Add the path flown and the plan ahead; next to the vehicle they run under its hull."""
        flight = self.run.flight
        low = np.array([0.0, 0.0, LOW if near else 0.0])
        if flight.index(t) > 0:
            here = float(flight.travelled[flight.index(t)])
            stops = np.arange(max(0.0, here - BEHIND) if near else 0.0, here, 0.2 if near else TRAIL)
            points = np.vstack([flight.x[np.searchsorted(flight.travelled, stops), :3], flight.state(t)[:3]])
            yield SceneElement.FLOWN, points - low
        plan = flight.plan(t)
        if plan is not None and t < flight.duration:  # at the end nothing is ahead
            for part, arcs in groupby(plan_arcs(plan, t, step=0.1), lambda arc: part_of(arc[0])):
                yield part, np.vstack([points for _, points in arcs]) - low

    def _foot(self, place: Array) -> Array:
        return np.array([place[0], place[1], float(self.run.flight.terrain.height(place[0], place[1]))])


def _model(run: QuadrotorRun, width: int, height: int, samples: int) -> Any:
    """Build the ground, the vehicle in its own group, and the airframe that represents it from afar."""
    spec = landscape(run.flight.terrain, width, height, samples)
    add_airframe(spec, "afar")
    add_vehicle(spec, VEHICLE)
    for geom in spec.geoms:
        if geom.name.startswith(f"{VEHICLE}/") and geom.group == DRAWN:
            geom.group, geom.material = NEAR_GROUP, "airframe"
    return spec.compile()
