"""A fleet drawn by MuJoCo: the ground, every vehicle in its colour with its path, its plan ahead and its slot.

Vehicles, lines and slots are drawn at a size in pixels, over the two worlds of ``mathnavi.renders.landscape``.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from itertools import groupby
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.renders.fleet.run_data import FleetRun
from mathnavi.renders.flight.run_data import FlightRun, plan_arcs, trail
from mathnavi.renders.framing import Box, framing
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
from mathnavi.renders.palette import Colour, Picture, SceneElement, part_of
from mathnavi.renders.stage import Optics, Stage, Staged, View

ARRIVAL = Optics(38.0, 2e-3, 6.0)
FREE = Box(0.25, 0.80, 0.17, 0.80)  # of a picture: between what is written on it
SIDES = (
    25.0,
    -25.0,
    60.0,
    -60.0,
    100.0,
    -100.0,
    140.0,
    -140.0,
    180.0,
)  # [degrees] of the sight, off the course
ELEVATIONS = (-32.0, -42.0, -52.0, -64.0, -78.0)  # [degrees], the flattest from which all slots are seen
SPAN = {"overview": 0.05, "top": 0.05, "arrival": 0.058}  # of the picture's height: an airframe
CROWD = 6  # vehicles from which on they are drawn smaller
PIN = 34.0  # [pixels] at a picture 720 pixels high: height of the pin over the slots
RING = 27.0  # [pixels] likewise: least radius of a slot, around the vehicle in it
CORNERS = np.linspace(0.0, 2.0 * math.pi, 25)  # of a ring
MOST_PIECES = 1500  # of the trails, and of the plans
DARK: Colour = (0.08, 0.10, 0.14)  # of no vehicle
APART = 17.0  # [pixels] at a picture 720 pixels high, between two labels


class FleetScene(Staged):
    """Scene as a context manager, see ``Staged``."""

    def __init__(self, run: FleetRun, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        self.run = run
        self._land = Landscape(run.terrain)
        self._radars = run.flights[0].mission.radars
        spec = landscape(run.terrain, width, height, samples)
        add_domes(spec, run.terrain, self._radars)
        for name, colour in zip(run.vehicles, run.colours, strict=True):
            add_airframe(spec, name, colour)
        self.model: Any = spec.compile()
        self._airframes = [Airframe(self.model, name) for name in run.vehicles]
        self._aspect = width / height
        self._sight = self._arrival_sight()
        self.stage = Stage(self.model, width, height, glow=0.75)

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]; ``turn`` [degrees] turns the overview and the arrival."""
        near = camera == "arrival"
        view = self._arrival(t, turn) if near else self._land.view(camera, self.run.course, turn, self._aspect)
        self.stage.look(view, ARRIVAL if near else OPTICS[camera], (TRUE_WORLD if near else TALL_WORLD, AIRFRAME))
        self._place_airframes(t, camera, view)
        place_domes(self.model, self.run.terrain, self._radars, t, 0.24)
        self.stage.begin(fog=False)
        for flight, colour in zip(self.run.flights, self.run.colours, strict=True):
            self._add_lines(flight, colour, t, camera)
        if near:
            self._add_slots(t)
        else:
            self._add_beacon(camera)
        return self.stage.end(sky=False)

    def world(self, points: Array, camera: str) -> Array:
        """(..., 3) map points [m] where the camera's world shows them."""
        return np.array(points, dtype=np.float64) if camera == "arrival" else self._land.tall(points)

    def pixels(self, points: Array, camera: str) -> Array:
        """(n, 3) column, row and depth [m] of map points (n, 3) in the picture drawn last; depth <= 0 is behind."""
        return self.stage.pixels(self.world(points, camera))

    def labels(self, t: float, camera: str) -> list[Label]:
        """The slots' name in the map's views, and the numbers of the vehicles as far as they do not hide each other."""
        found: list[Label] = []
        if camera != "arrival":
            top = self._slots_middle()
            unit = float(self.stage.metres_per_pixel(self.world(top[None], camera))[0]) * self.stage.unit
            head = self.world(top, camera) + np.array([0.0, 0.0, PIN * unit])
            found += [Label("slots", *place) for place in self.stage.inside(head[None]).tolist()]
        for number, place in enumerate(self.run.positions(t), start=1):
            for column, row in self.stage.inside(self.world(place[None], camera)).tolist():
                if all(math.hypot(column - other.column, row - other.row) > APART * self.stage.unit for other in found):
                    found.append(Label(str(number), column, row))
        return found

    # ---- cameras

    def _arrival(self, t: float, turn: float) -> View:
        """All slots and all vehicles, which come nearer."""
        points = np.vstack([self.run.slots, self.run.positions(t)])
        azimuth, elevation = self._sight
        return framing(points, FREE, ARRIVAL, self._aspect, (azimuth + turn, elevation))

    def _arrival_sight(self) -> tuple[float, float]:
        """Azimuth and elevation [degrees] from which no mountain hides a slot at the end, as flat as may be."""
        course = self.run.course
        along = math.degrees(math.atan2(course[1], course[0]))
        places = np.vstack([self.run.slots, self.run.positions(self.run.duration)])
        for elevation in ELEVATIONS:
            for side in SIDES:
                sight = (along + side, elevation)
                eye = framing(places, FREE, ARRIVAL, self._aspect, sight).eye
                if self.run.terrain.visible(eye, self.run.slots).all():
                    return sight
        return along, ELEVATIONS[-1]

    # ---- what is drawn

    def _place_airframes(self, t: float, camera: str, view: View) -> None:
        share = SPAN[camera] * min(1.0, math.sqrt(CROWD / len(self._airframes)))
        for flight, airframe in zip(self.run.flights, self._airframes, strict=True):
            x = flight.state(t)
            # Drawn level: tilted, it could turn its edge to the camera and be lost to sight.
            position, quaternion = airframe_pose(x[:3], x[3:], np.zeros(3))
            position = self.world(position, camera)
            span = share * 2.0 * float(np.linalg.norm(view.eye - position)) * self.stage.tangent()
            airframe.place_afar(self.stage, position, quaternion, span, view.eye)

    def _add_lines(self, flight: FlightRun, colour: Colour, t: float, camera: str) -> None:
        pieces = MOST_PIECES / len(self.run.flights)
        if flight.index(t) > 0:
            step = max(float(flight.travelled[-1]), 1.0) / min(pieces, 260.0)
            fine = 60.0 if camera == "arrival" and len(self.run.flights) <= CROWD else step
            self.stage.line(self.world(trail(flight, t, min(fine, step), step), camera), colour, 3.6)
        plan = flight.plan(t)
        if plan is not None and t < self.run.duration:  # at the end nothing is ahead
            step = max(0.6, (plan.t_end - t) / pieces)
            for part, arcs in groupby(plan_arcs(plan, t, step), lambda arc: part_of(arc[0])):
                if camera == "arrival" and part is SceneElement.COMPLETION:
                    continue  # how it would rest if it had to: up and down again, far higher than the picture
                points = np.vstack([points for _, points in arcs])
                self.stage.line(self.world(points, camera), colour, 1.7, dashed=part is SceneElement.COMPLETION)
        place = flight.state(t)[:3]
        # A plumb line shows where over the ground the vehicle is.
        if self.run.terrain.contains(place[0], place[1]):
            self.stage.line(self.world(np.array([self._foot(place), place]), camera), colour, 1.4)
        if camera != "arrival":
            start = self.world(flight.mission.start, camera)
            pixel = float(self.stage.metres_per_pixel(start[None])[0]) * self.stage.unit
            self.stage.capsule(start, start + np.array([0.0, 0.0, 0.1 * pixel]), 4.5 * pixel, colour)

    def _add_slots(self, t: float) -> None:
        """A ring on a column for each, filled when its vehicle has arrived."""
        run = self.run
        for flight, colour, arrival in zip(run.flights, run.colours, run.arrivals, strict=True):
            slot = flight.mission.target
            pixel = float(self.stage.metres_per_pixel(slot[None])[0]) * self.stage.unit
            radius = max(flight.mission.arrival_radius, RING * pixel)
            rim = np.column_stack([np.cos(CORNERS), np.sin(CORNERS), np.zeros_like(CORNERS)])
            self.stage.line(slot + radius * rim, colour, 3.0)
            self.stage.line(np.array([self._foot(slot), slot]), colour, 2.0)
            if arrival <= t:
                self.stage.disc(slot, np.array([radius, radius]), 0.0, (*colour, 0.45))

    def _add_beacon(self, camera: str) -> None:
        """A pin over the middle of the slots: on the map they are one place."""
        middle = self._slots_middle()
        foot, top = self.world(np.array([self._foot(middle), middle]), camera)
        self.stage.pin(foot, top, PIN, DARK)

    def _slots_middle(self) -> Array:
        middle: Array = self.run.slots.mean(axis=0)
        return middle

    def _foot(self, place: Array) -> Array:
        return np.array([place[0], place[1], float(self.run.terrain.height(place[0], place[1]))])
