"""A quadrotor in the browser: the vehicle as it tilts, over the ground, with its path and the plan of the moment."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from mathnavi.models.quadrotor.dynamics import ATTITUDE
from mathnavi.models.quadrotor.entity import add_vehicle
from mathnavi.renders.flight.web import VEHICLE
from mathnavi.renders.flight.web import web_scene as flight_scene
from mathnavi.renders.framing import framing
from mathnavi.renders.landscape import OPTICS
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.quadrotor.run_data import QuadrotorRun
from mathnavi.renders.quadrotor.scene import DRAWN, FREE, SIGHT
from mathnavi.renders.web.bodies import body_surfaces, model_shapes
from mathnavi.renders.web.charts import TRUTH, curve
from mathnavi.renders.web.elements import Camera, Chart, Layer, Motion, WebScene
from mathnavi.renders.web.landscape import ASPECT, chase

CHASE_DISTANCE, CHASE_BEHIND = 10.0, 0.6  # in reaches of the vehicle, [s]


def web_scene(run: QuadrotorRun) -> WebScene:
    """Return the scene of a flight of a quadrotor."""
    flight = flight_scene(run.flight)
    layer = Layer.for_element(SceneElement.FLOWN)
    spec = mujoco.MjSpec()
    add_vehicle(spec, VEHICLE)
    model = spec.compile()
    still = np.zeros((model.nbody, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (model.nbody, 1))
    own = body_surfaces(
        model_shapes(model, [DRAWN]), dict.fromkeys(range(1, model.nbody), VEHICLE), still, endless=1.0, layer=layer,
        glow=0.3, span=2.0 * run.reach,
    )  # fmt: skip
    rest = [each for each in flight.surfaces if each.motion != VEHICLE]
    x, terrain = run.flight.x, run.flight.terrain
    below = terrain.height(np.clip(x[:, 0], 0.0, terrain.width), np.clip(x[:, 1], 0.0, terrain.depth))
    motion = Motion(run.flight.t, x[:, :3], run.truth[:, ATTITUDE], ground=np.asarray(below)).thinned()
    near = chase("follow the vehicle", VEHICLE, CHASE_DISTANCE * run.reach, CHASE_BEHIND, 0.0)
    cameras = [*_map_views(run), near]
    return replace(
        flight, cameras=cameras, motions={**flight.motions, VEHICLE: motion}, surfaces=[*rest, *own],
        charts=quadrotor_charts(run), note="",
    )  # fmt: skip


def _map_views(run: QuadrotorRun) -> list[Camera]:
    """Return the views of the map as in its pictures, with true heights."""
    terrain, found = run.flight.terrain, []
    heights = (float(terrain.z.min()), float(terrain.z.max()))
    corners = np.array([[x, y, z] for x in (0.0, terrain.width) for y in (0.0, terrain.depth) for z in heights])
    for name, sight in SIGHT.items():
        view = framing(corners, FREE[name], OPTICS[name], ASPECT, sight)
        place = (float(view.lookat[0]), float(view.lookat[1]), float(view.lookat[2]))
        degrees = OPTICS[name].field_of_view
        found.append(
            Camera(name, place, view.distance, view.azimuth, view.elevation, field_of_view=degrees, span=0.075)
        )
    return found


def quadrotor_charts(run: QuadrotorRun) -> list[Chart]:
    """Clearance, distance from the plan, tilt and thrusts."""
    t, mission = run.flight.t, run.flight.mission
    horizontal, vertical = run.tracking_error.T
    speed = np.linalg.norm(run.flight.x[:, 3:6], axis=1)
    colours = ((1.00, 0.50, 0.05), (0.05, 0.42, 0.95), (0.86, 0.10, 0.72), (0.10, 0.78, 0.48))
    thrusts = [
        curve(f"rotor {k + 1}", colours[k], t, run.thrusts[:, k], step=True) for k in range(run.thrusts.shape[1])
    ]
    return [
        Chart(
            "clearance of the vehicle", "m", [curve("", TRUTH, t, run.clearance)], [mission.clearance_min],
            logarithmic=True,
        ),
        Chart(
            "distance from the plan", "m",
            [curve("horizontal", colours[1], t, horizontal), curve("vertical", colours[2], t, vertical)],
            [run.bound["horizontal"], run.bound["vertical"]],
        ),
        Chart("speed", "m/s", [curve("", TRUTH, t, speed)], [mission.speed_max]),
        Chart("tilt", "degrees", [curve("", TRUTH, t, run.tilt)]),
        Chart("thrust", "N", thrusts, [run.thrust_max]),
    ]  # fmt: skip
