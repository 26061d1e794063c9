"""A fleet in the browser: every vehicle in its colour with its path and its plan, the slots, radars."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mathnavi.renders.fleet.run_data import FleetRun
from mathnavi.renders.flight.web import CHASE_BEHIND, CHASE_DISTANCE, CHASE_SPAN, height
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.web.charts import TRUTH, curve
from mathnavi.renders.web.elements import Camera, Chart, Layer, Mark, WebScene
from mathnavi.renders.web.landscape import (
    MAP_NOTE,
    airframe,
    airframe_motion,
    chase,
    flown,
    ground,
    map_cameras,
    plan_lines,
    radar_domes,
    scale_marks,
)

PARTS = (SceneElement.OPTIMISED, SceneElement.MANOEUVRE, SceneElement.COMPLETION)
SLOT_DISTANCE = 6.0  # of the camera before the slots, in their greatest distance


def web_scene(run: FleetRun) -> WebScene:
    """Return the scene of a fleet's flight."""
    motions, domes = radar_domes(run.flights[0].mission.radars, run.terrain, run.duration)
    surfaces, lines, marks, cameras = [*ground(run.terrain), *domes], [], [], []
    for (name, flight), colour in zip(run.vehicles.items(), run.colours, strict=True):
        layer = Layer(name, colour)
        motions[name] = airframe_motion(flight.t, flight.x, flight.u, run.terrain)
        surfaces += airframe(name, layer, colour)
        lines.append(flown(flight.t, flight.x[:, :3], layer))
        plans = flight.log.plans, flight.log.adopted, run.duration
        lines += plan_lines(*plans, dict.fromkeys(PARTS, layer), colour)
        marks.append(Mark(name, colour, motion=name, layer=layer, dot=False))
        cameras.append(chase(f"follow {name}", name, CHASE_DISTANCE, CHASE_BEHIND, CHASE_SPAN))
        place = flight.mission.target
        marks.append(Mark("slot", colour, place, layer=layer, foot=height(flight, place)))
    return WebScene(
        run.title,
        run.duration,
        [*map_cameras(run.terrain, run.course), _slots(run), *cameras],
        motions,
        surfaces,
        lines,
        [*marks, *scale_marks(run.terrain)],
        fleet_charts(run),
        low=float(run.terrain.z.min()),
        note=MAP_NOTE,
    )


def _slots(run: FleetRun) -> Camera:
    """The slots from where the vehicles come."""
    middle = run.slots.mean(axis=0)
    apart = max(float(np.linalg.norm(run.slots - middle, axis=1).max()), 100.0)
    course = float(np.degrees(np.arctan2(run.course[1], run.course[0])))
    place = (float(middle[0]), float(middle[1]), float(middle[2]))
    near = chase("the slots", "", SLOT_DISTANCE * apart, 0.0, 0.06, -32.0)
    return replace(near, target=place, azimuth=course + 25.0, follow=None)


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
