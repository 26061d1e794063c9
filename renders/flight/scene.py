"""A flight as a scene: ground, airframe, path, the plan of the moment, radars, start and target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.palette import COLOURS, SceneElement
from mathnavi.renders.scene.cameras import chase
from mathnavi.renders.scene.charts import TRUTH, curve
from mathnavi.renders.scene.elements import Camera, Chart, Layer, Mark, Scene
from mathnavi.renders.scene.landscape import (
    MAP_NOTE,
    airframe,
    airframe_motion,
    flown,
    map_cameras,
    plan_lines,
    radar_domes,
    scale_marks,
    vehicle_motion,
)

VEHICLE, TARGET = "vehicle", "target"
PLAN_LAYERS = {
    SceneElement.OPTIMISED: Layer.for_element(SceneElement.OPTIMISED),
    SceneElement.MANOEUVRE: Layer.for_element(SceneElement.MANOEUVRE),
    SceneElement.COMPLETION: Layer.for_element(SceneElement.COMPLETION, dashed=True),
}


def flight_scene(run: FlightRun) -> Scene:
    """Return the scene of a flight."""
    mission, terrain = run.mission, run.terrain
    layer = Layer.for_element(SceneElement.FLOWN)
    radar_motions, domes = radar_domes(mission.radars, terrain, run.duration)
    motions = {VEHICLE: airframe_motion(run.t, run.x, run.u, terrain), **radar_motions}
    start, target = ((part.value, COLOURS[part]) for part in (SceneElement.START, SceneElement.TARGET))
    marks = [Mark(*start, mission.start, foot=height(run, mission.start))]
    if len(mission.target_path):
        times = np.unique(np.concatenate([[0.0, run.duration], mission.target_path[:, 0]]))
        motions[TARGET] = vehicle_motion(times, np.array([mission.target_at(float(t)) for t in times]), None, terrain)
        marks.append(Mark(*target, motion=TARGET))
    else:
        marks.append(Mark(*target, mission.target, foot=height(run, mission.target)))
    several = len(mission.radars) > 1
    marks += [
        Mark(f"{SceneElement.RADAR.value} {k}" if several else SceneElement.RADAR.value, COLOURS[SceneElement.RADAR],
             motion=name, layer=Layer.for_element(SceneElement.RADAR))
        for k, name in enumerate(radar_motions, start=1)
    ]  # fmt: skip
    return Scene(
        run.title,
        run.duration,
        [
            *map_cameras(terrain, mission.target - mission.start),
            replace(follow(VEHICLE), name="follow the vehicle", shot="chase"),
        ],
        motions,
        [*airframe(VEHICLE, layer), *domes],
        [flown(run.t, run.x[:, :3], layer), *plan_lines(run.log.plans, run.log.adopted, run.duration, PLAN_LAYERS)],
        [*marks, *scale_marks(terrain)],
        flight_charts(run),
        ground=terrain,
        note=MAP_NOTE,
    )


def follow(vehicle: str) -> Camera:
    """The camera behind a vehicle."""
    return replace(chase(f"follow {vehicle}", vehicle, 1300.0, 4.0, 0.15), clear=110.0)


def height(run: FlightRun, place: Array) -> float:
    """Height [m] of the ground below a place (x, y, ...) [m]."""
    return float(run.terrain.height(place[0], place[1]))


def flight_charts(run: FlightRun) -> list[Chart]:
    """Height above the ground, speed and acceleration against their bounds."""
    mission, t = run.mission, run.t
    speed, acceleration = np.linalg.norm(run.x[:, 3:6], axis=1), np.linalg.norm(run.u, axis=1)
    return [
        Chart(
            "height above ground",
            "m",
            [curve("", TRUTH, t, run.above_ground)],
            [mission.clearance_min],
            logarithmic=True,
        ),
        Chart("speed", "m/s", [curve("", TRUTH, t, speed)], [mission.speed_max]),
        Chart("acceleration", "m/s²", [curve("", TRUTH, t, acceleration, step=True)], [mission.acceleration_max]),
        Chart("height", "m", [curve("", TRUTH, t, run.x[:, 2])]),
    ]
