"""A flight as a scene: ground, airframe, path, the plan of the moment, radars, start and target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.palette import COLOURS, SceneElement
from mathnavi.renders.scene.cameras import chase
from mathnavi.renders.scene.charts import TRUTH, curve
from mathnavi.renders.scene.elements import Camera, Chart, Layer, Lines, Mark, Motion, Scene, Surface
from mathnavi.renders.scene.landscape import (
    MAP_NOTE,
    airframe,
    airframe_motion,
    flown,
    mission_cameras,
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
    layer = Layer.for_element(SceneElement.FLOWN)
    course = run.mission.target - run.mission.start
    return mission_scene(
        run,
        [
            *mission_cameras(run.terrain, places_of(run), course),
            replace(follow(VEHICLE), name="follow the vehicle", shot="chase"),
        ],
        airframe_motion(run.t, run.x, run.u, run.terrain),
        airframe(VEHICLE, layer),
        [flown(run.t, run.x[:, :3], layer), *plan_lines(run.log.plans, run.log.adopted, run.duration, PLAN_LAYERS)],
        flight_charts(run),
        MAP_NOTE,
    )


def places_of(run: FlightRun) -> Array:
    """Places (n, 3) [m] of what happens in a flight: its path, its plans, and where its target is and goes."""
    mission = run.mission
    plans = [plan.x[:, :3] for plan in run.log.plans]
    places = np.vstack(
        [mission.start, mission.target, mission.target_path[:, 1:], mission.beacons, run.x[:, :3], *plans]
    )
    return places[np.isfinite(places).all(axis=1)]


def mission_scene(
    run: FlightRun,
    cameras: Sequence[Camera],
    motion: Motion,
    vehicle: Sequence[Surface],
    lines: Sequence[Lines],
    charts: Sequence[Chart],
    note: str = "",
) -> Scene:
    """Return the scene of a vehicle on its motion ``VEHICLE``, with the ground, radars, start and target."""
    mission, terrain = run.mission, run.terrain
    radar_motions, domes = radar_domes(mission.radars, terrain, run.duration)
    motions = {VEHICLE: motion, **radar_motions}
    start, target = ((part.value, COLOURS[part]) for part in (SceneElement.START, SceneElement.TARGET))
    marks = [Mark(*start, mission.start, foot=height(run, mission.start))]
    if len(mission.target_path):
        times = np.unique(np.concatenate([[0.0, run.duration], mission.target_path[:, 0]]))
        motions[TARGET] = vehicle_motion(times, np.array([mission.target_at(float(t)) for t in times]), None, terrain)
        marks.append(Mark(*target, motion=TARGET))
    else:
        marks.append(Mark(*target, mission.target, foot=height(run, mission.target)))
    name, colour = SceneElement.RADAR.value, COLOURS[SceneElement.RADAR]
    marks += [
        Mark(f"{name} {k}" if len(mission.radars) > 1 else name, colour, motion=radar, layer=domes[0].layer)
        for k, radar in enumerate(radar_motions, start=1)
    ]
    name, colour = SceneElement.BEACON.value, COLOURS[SceneElement.BEACON]
    marks += [
        Mark(f"{name} {k}", colour, place, foot=height(run, place), brief=f"{k}")
        for k, place in enumerate(mission.beacons)
    ]
    surfaces, marks = [*vehicle, *domes], [*marks, *scale_marks(terrain)]
    return Scene(run.title, run.duration, cameras, motions, surfaces, lines, marks, charts, ground=terrain, note=note)


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
