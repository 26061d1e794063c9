"""A quadrotor's flight as a scene: the vehicle as it tilts, over the ground, with its path and the plan of the moment.

The world is the true one, heights and all, and the vehicle the model that flew, its rotors turning far more slowly
than they do.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from mathnavi.models.quadrotor.dynamics import ATTITUDE, ROTORS
from mathnavi.models.quadrotor.entity import add_vehicle
from mathnavi.renders.flight.scene import PLAN_LAYERS, VEHICLE, mission_scene
from mathnavi.renders.framing import Box
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.quadrotor.run_data import QuadrotorRun
from mathnavi.renders.scene.bodies import body_surfaces, model_shapes
from mathnavi.renders.scene.cameras import chase
from mathnavi.renders.scene.charts import TRUTH, curve
from mathnavi.renders.scene.elements import Chart, Framed, Layer, Scene, Surface
from mathnavi.renders.scene.landscape import corners, flown, map_camera, plan_lines, vehicle_motion

DRAWN = 2  # the group of the vehicle's geoms that are to be seen
SPIN = 23.0  # [rad/s] at which rotors are drawn to turn
SIGHT = {"overview": (72.0, -52.0), "top": (90.0, -89.9)}  # [degrees] azimuth and elevation
FREE = {"overview": Box(0.02, 0.98, 0.06, 0.98), "top": Box(0.03, 0.97, 0.03, 0.97)}  # of the picture, for the map
DISTANCE, BEHIND, CLEAR, WIDE = 7.0, 1.0, 1.2, 50.0  # of the camera that follows: in reaches, [s], [m], [degrees]
FINE = 0.01  # [m] by which a plan that bends may be off, as it is drawn
LOW = np.array(
    [0.0, 0.0, 0.16]
)  # [m] under the vehicle's centre its path and plan are drawn: beside it, not through it


def quadrotor_scene(run: QuadrotorRun) -> Scene:
    """Return the scene of a flight of a quadrotor."""
    flight, terrain, layer = run.flight, run.flight.terrain, Layer.for_element(SceneElement.FLOWN)
    box = corners(terrain, float(terrain.z.min()), float(terrain.z.max()))
    near = chase("follow the vehicle", VEHICLE, DISTANCE * run.reach, BEHIND, 0.0)
    plans = [replace(plan, x=plan.x - np.pad(LOW, (0, 3))) for plan in flight.log.plans]
    return mission_scene(
        flight,
        [
            *(map_camera(name, Framed(box, FREE[name]), sight) for name, sight in SIGHT.items()),
            replace(near, field_of_view=WIDE, shot="chase", clear=CLEAR),
        ],
        vehicle_motion(flight.t, flight.x[:, :3], run.truth[:, ATTITUDE], terrain),
        _vehicle(layer, 2.0 * run.reach),
        [
            flown(flight.t, flight.x[:, :3] - LOW, layer),
            *plan_lines(plans, flight.log.adopted, run.duration, PLAN_LAYERS, fine=FINE),
        ],
        quadrotor_charts(run),
    )


def _vehicle(layer: Layer, span: float) -> list[Surface]:
    """The vehicle, ``span`` [m] across, with rotors that turn about their hubs."""
    spec = mujoco.MjSpec()
    add_vehicle(spec, VEHICLE)
    model = spec.compile()
    rotors = {model.body(f"{VEHICLE}/{rotor}").id: rotor for rotor in ROTORS}
    still = np.zeros((model.nbody, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (model.nbody, 1))
    found = []
    for each in body_surfaces(
        model_shapes(model, [DRAWN]), rotors, still, endless=1.0, layer=layer, glow=0.3, span=span
    ):
        hub, spin = np.zeros(3), 0.0
        if each.motion is not None:
            hub = model.body(f"{VEHICLE}/{each.motion}").pos
            spin = SPIN if ROTORS.index(each.motion) % 2 else -SPIN
        found.append(replace(each, vertices=each.vertices + hub, motion=VEHICLE, spin=spin, axle=(hub[0], hub[1])))
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
