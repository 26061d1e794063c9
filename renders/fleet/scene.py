"""A fleet as a scene: every vehicle in its colour with its path and its plan, the slots, radars."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mathnavi.renders.fleet.run_data import FleetRun
from mathnavi.renders.flight.scene import follow, height, places_of
from mathnavi.renders.framing import Box, framing
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.scene.cameras import ASPECT
from mathnavi.renders.scene.charts import TRUTH, curve
from mathnavi.renders.scene.elements import Camera, Chart, Framed, Layer, Mark, Scene
from mathnavi.renders.scene.landscape import (
    MAP_NOTE,
    airframe,
    airframe_motion,
    flown,
    mission_cameras,
    plan_lines,
    radar_domes,
    scale_marks,
)

PARTS = (SceneElement.OPTIMISED, SceneElement.MANOEUVRE, SceneElement.COMPLETION)
MOST_NAMED = 8  # starts that have a name: of more they hide each other
SPAN = 0.06  # of the picture's height: an airframe
CROWD = 6  # vehicles from which on they are drawn smaller
SLOT_DISTANCE = 6.0  # of the camera before the slots, in their greatest distance
FREE = Box(0.25, 0.80, 0.17, 0.80)  # of a picture: between what is written on it
FIELD_OF_VIEW = 38.0  # [degrees]
SIDES = (25.0, -25.0, 60.0, -60.0, 100.0, -100.0, 140.0, -140.0, 180.0)  # [degrees] of the sight, off the course
ELEVATIONS = (-32.0, -42.0, -52.0, -64.0, -78.0)  # [degrees], the flattest from which all slots are seen


def fleet_scene(run: FleetRun) -> Scene:
    """Return the scene of a fleet's flight."""
    motions, surfaces = radar_domes(run.flights[0].mission.radars, run.terrain, run.duration)
    lines, names, starts, slots, cameras = [], [], [], [], []
    span = SPAN * min(1.0, math.sqrt(CROWD / len(run.flights)))
    each = zip(run.vehicles.items(), run.colours, run.arrivals.tolist(), strict=True)
    for number, ((name, flight), colour, arrival) in enumerate(each, start=1):
        layer = Layer(name, colour)
        motions[name] = airframe_motion(flight.t, flight.x, flight.u, run.terrain)
        surfaces += airframe(name, layer, colour)
        lines.append(flown(flight.t, flight.x[:, :3], layer))
        plans = flight.log.plans, flight.log.adopted, run.duration
        lines += plan_lines(*plans, dict.fromkeys(PARTS, layer), colour)
        names.append(Mark(name, colour, motion=name, layer=layer, dot=False, brief=str(number)))
        starts.append(Mark(name if len(run.flights) <= MOST_NAMED else "", colour, flight.mission.start, layer=layer))
        cameras.append(follow(name))
        place = flight.mission.target
        slots.append(
            Mark(
                "slot", colour, place, layer=layer, foot=height(flight, place), brief="slots",
                ring=flight.mission.arrival_radius, filled=arrival,
            )
        )  # fmt: skip
    places = np.vstack([places_of(flight) for flight in run.flights])
    views = (*mission_cameras(run.terrain, places, run.course), _slots(run))
    return Scene(
        run.title,
        run.duration,
        [
            *(replace(each, span=span) for each in views),
            *cameras,
        ],
        motions,
        surfaces,
        lines,
        [*names, *slots, *starts, *scale_marks(run.terrain)],
        fleet_charts(run),
        ground=run.terrain,
        note=MAP_NOTE,
    )


def _slots(run: FleetRun) -> Camera:
    """The slots from where the vehicles come; in a video with the vehicles, which come nearer."""
    middle = run.slots.mean(axis=0)
    apart = max(float(np.linalg.norm(run.slots - middle, axis=1).max()), 100.0)
    return Camera(
        "the slots", tuple(middle.tolist()), SLOT_DISTANCE * apart, *_sight(run), field_of_view=FIELD_OF_VIEW,
        shot="arrival", framed=Framed(run.slots, FREE, tuple(run.vehicles)), dashed=False,
    )  # fmt: skip


def _sight(run: FleetRun) -> tuple[float, float]:
    """Azimuth and elevation [degrees] from which no mountain hides a slot at the end, as flat as may be."""
    along = math.degrees(math.atan2(run.course[1], run.course[0]))
    places = np.vstack([run.slots, run.positions(run.duration)])
    for elevation in ELEVATIONS:
        for side in SIDES:
            sight = (along + side, elevation)
            eye = framing(places, FREE, FIELD_OF_VIEW, ASPECT, sight).eye
            if run.terrain.visible(eye, run.slots).all():
                return sight
    return along, ELEVATIONS[-1]


def fleet_charts(run: FleetRun) -> list[Chart]:
    """Distance to the nearest other vehicle, to the slot, height above the ground and speed."""
    nearest = run.neighbours.min(axis=0)
    several = list(zip(run.vehicles.items(), run.colours, strict=True))
    return [
        Chart(
            "distance of the nearest pair", "m", [curve("", TRUTH, run.t, nearest)], [run.separation], logarithmic=True,
        ),
        Chart(
            "distance to the slot", "m",
            [
                curve(name, colour, f.t, np.maximum(np.linalg.norm(f.x[:, :3] - f.mission.target, axis=1), 1.0))
                for (name, f), colour in several
            ],
            logarithmic=True,
        ),
        Chart(
            "height above ground", "m", [curve(name, colour, f.t, f.above_ground) for (name, f), colour in several],
            [run.flights[0].mission.clearance_min], logarithmic=True,
        ),
        Chart(
            "speed", "m/s",
            [curve(name, colour, f.t, np.linalg.norm(f.x[:, 3:6], axis=1)) for (name, f), colour in several],
            [run.flights[0].mission.speed_max],
        ),
    ]  # fmt: skip
