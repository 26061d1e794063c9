"""Pictures of runs, with and without parts of what they show: KIND OUT.npz RUN_DIR [RUN_DIR ...].

``tests.renders.drawn`` runs it, with OpenGL's backend chosen in the environment. Arrays are named CAMERA.with,
CAMERA.pixels (m, 3) where what matters should be, CAMERA.labels, CAMERA.without.PART, and CAMERA.earlier, without all
parts at an earlier time.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.fleet.scene import fleet_scene
from mathnavi.renders.flight.scene import flight_scene
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.scene import MechanismScene
from mathnavi.renders.missile.scene import MissileScene
from mathnavi.renders.quadrotor.scene import quadrotor_scene
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.renders.ranging.scene import ABOVE, ROBOT_GROUP, RangingScene
from mathnavi.renders.scene.elements import Layer, Scene
from mathnavi.renders.scene.mujoco import MujocoScene
from tests.renders.ranging.believers import ELSEWHERE

NOT_DRAWN = 5  # a group of geoms that no scene shows
EARLY = 0.2  # [s] the estimate of a robot is well off
MOMENTS = (0.2, 0.5, 1.9)  # [s] its hypotheses fade, and one after the other is dropped
MOMENT = 0.3  # [s] the estimate of a mechanism is still off

Arrays = dict[str, Array]


# ---- vehicles in the scenes of flights


@dataclass(frozen=True)
class Vehicles:
    """Parts of a scene, and when they are drawn."""

    scene: Callable[[Any], Any]  # of a run
    left_out: Callable[[Any, str], AbstractContextManager[None]]  # a part of a scene, within the block
    parts: Callable[[Any], Iterable[str]]  # of a run
    moments: Mapping[str, float]  # by camera, a share of the run
    places: Callable[[Any, float], Array]  # (m, 3) of a run at a time [s]
    earlier: float | None = None  # share of the run
    targets: Callable[[Any], Array] | None = None  # (m, 3) places that the cameras should have in sight too


def described(describe: Callable[[Any], Scene]) -> Callable[[Any], MujocoScene]:
    """Scenes of a description."""
    return lambda run: MujocoScene(describe(run), 320, 180)


@contextmanager
def without_motion(scene: MujocoScene, motion: str) -> Iterator[None]:
    """Draw no surface of a motion."""
    whole, hidden = scene.scene, Layer(motion, shown=False)
    kept = [replace(each, layer=hidden) if each.motion == motion else each for each in whole.surfaces]
    scene.scene = replace(whole, surfaces=kept)
    yield
    scene.scene = whole


@contextmanager
def without_missile(scene: MissileScene, _: str) -> Iterator[None]:
    """Draw no missile."""
    groups, own = scene.model.geom_group.copy(), scene.model.geom_bodyid == scene.model.body("missile/body").id
    scene.model.geom_group[own] = NOT_DRAWN
    yield
    scene.model.geom_group[:] = groups


VEHICLES = {
    "flight": Vehicles(
        described(flight_scene),
        without_motion,
        lambda run: ["vehicle"],
        {"chase": 0.5, "overview": 0.5, "top": 0.5},
        lambda run, t: run.state(t)[None, :3],
        earlier=0.0,
    ),
    "missile": Vehicles(
        lambda run: MissileScene(run, 320, 180),
        without_missile,
        lambda run: ["missile"],
        {"chase": 0.55, "side": 0.6, "target": 0.96},
        lambda run, t: run.path[[run.index(t)]],
        earlier=0.3,
    ),
    "quadrotor": Vehicles(
        described(quadrotor_scene),
        without_motion,
        lambda run: ["vehicle"],
        {"chase": 0.5, "overview": 0.5, "top": 0.5},
        lambda run, t: run.pose(t)[0][None],
    ),
    "fleet": Vehicles(
        described(fleet_scene),
        without_motion,
        lambda run: run.vehicles,
        {"overview": 0.4, "top": 0.5, "arrival": 0.9},
        lambda run, t: run.positions(t),
        targets=lambda run: run.slots,
    ),
}


def draw_vehicles(vehicles: Vehicles, run: Any) -> Arrays:
    """Each camera's picture with all vehicles, and without each of them."""
    times = {camera: share * run.duration for camera, share in vehicles.moments.items()}
    arrays: Arrays = {}
    with vehicles.scene(run) as scene:
        first = {camera: scene.draw(t, camera) for camera, t in times.items()}
        for camera, t in times.items():
            arrays[f"{camera}.with"] = scene.draw(t, camera)
            assert np.array_equal(arrays[f"{camera}.with"], first[camera])  # whatever was drawn in between
            pixels = getattr(scene, "pixels", lambda points, _: scene.stage.pixels(points))
            arrays[f"{camera}.pixels"] = pixels(vehicles.places(run, t), camera)
            arrays[f"{camera}.labels"] = np.array([label.text for label in scene.labels(t, camera)])
            if vehicles.targets is not None:
                arrays[f"{camera}.targets"] = pixels(vehicles.targets(run), camera)
        if vehicles.targets is not None:
            arrays["end"] = scene.draw(run.duration, camera)
            arrays["end.targets"] = pixels(vehicles.targets(run), camera)
        for name in vehicles.parts(run):
            with vehicles.left_out(scene, name):
                for camera, t in times.items():
                    arrays[f"{camera}.without.{name}"] = scene.draw(t, camera)
                    if vehicles.earlier is not None:
                        arrays[f"{camera}.earlier"] = scene.draw(vehicles.earlier * run.duration, camera)
    return arrays


# ---- robots with range sensors


def raised(pose: Array) -> Array:
    """(1, 3) the place of a pose, above the robot's lid."""
    return np.array([[*pose[:2], ABOVE]])


def blind(run: RangingRun) -> RangingRun:
    """The run of a robot whose estimator says nothing."""
    beliefs = replace(
        run.beliefs, t=np.empty(0), x=np.empty((0, 3)), covariance=None, hypotheses=None, scores=None, z=None
    )
    return replace(run, beliefs=beliefs)


def draw_bank(run: RangingRun) -> Arrays:
    arrays: Arrays = {}
    with RangingScene(run, 480, 270) as scene:
        for camera in ("top", "chase"):
            arrays[f"{camera}.with"] = scene.draw(EARLY, camera)
            arrays[f"{camera}.robot"] = scene.stage.pixels(raised(run.joints(EARLY)))[0]
            arrays[f"{camera}.estimate"] = scene.stage.pixels(raised(run.beliefs.x[run.belief(EARLY)]))[0]
            arrays[f"{camera}.labels"] = np.array([label.text for label in scene.labels(EARLY, camera)])
        for moment in MOMENTS:
            arrays[f"hypotheses.{moment}"] = scene.draw(moment, "top")
        arrays["hypotheses.at"] = np.array([scene.stage.pixels(raised(pose))[0] for pose in ELSEWHERE])
        arrays["image.at"] = scene.stage.pixels(raised(run.curve.images(run.joints(1.9)[:3])[1]))[0]
        scene.run = blind(run)
        for camera in ("top", "chase"):
            arrays[f"{camera}.without.estimate"] = scene.draw(EARLY, camera)
        scene.model.geom_group[scene.model.geom_group == ROBOT_GROUP] = NOT_DRAWN
        for camera in ("top", "chase"):
            arrays[f"{camera}.without.both"] = scene.draw(EARLY, camera)
    return arrays


def draw_observer(run: RangingRun) -> Arrays:
    with RangingScene(run, 480, 270) as scene:
        arrays: Arrays = {"observer.chase": scene.draw(0.4, "chase")}
        arrays["observer.ends"] = scene.draw(0.4, "top")
        assert run.beliefs.z is not None
        ends = run.curve.points(run.beliefs.z[run.belief(0.4), :-1])
        arrays["ends.at"] = np.vstack([scene.stage.pixels(raised(end)) for end in ends])
        scene.run = replace(run, beliefs=replace(run.beliefs, z=None))
        return arrays | {"observer.without.ends": scene.draw(0.4, "top")}


# ---- mechanisms


def draw_mechanism(name: str, run: LagrangianRun) -> Arrays:
    def seen(position: Array) -> Array:
        """(m, 3) column, row and depth of the middles of what moves, at a position (nq,)."""
        return scene.stage.pixels(scene.places(position))

    with MechanismScene(run, 480, 270) as scene:
        arrays: Arrays = {f"{name}.with": scene.draw(MOMENT, "scene"), f"{name}.truth": seen(run.position(MOMENT))}
        arrays[f"{name}.estimate"] = seen(run.drawn(run.belief(MOMENT)))
        if (reference := run.reference(MOMENT)) is not None:
            arrays[f"{name}.reference"] = seen(reference)
            summary = {key: value for key, value in run.log.summary.items() if key != "attitude_rms_rad"}
            scene.run = replace(run, log=replace(run.log, summary=summary))
            arrays[f"{name}.without.reference"] = scene.draw(MOMENT, "scene")
            scene.run = run
        run.errors.found[:] = 0.0
        arrays[f"{name}.without.estimate"] = scene.draw(MOMENT, "scene")
        moves = scene.model.body_weldid[scene.model.geom_bodyid] != 0
        scene.model.geom_rgba[moves, 3] = 0.0
        scene.model.geom_matid[moves] = -1
        arrays[f"{name}.without.both"] = scene.draw(MOMENT, "scene")
    return arrays


def main(kind: str, out: str, *folders: str) -> None:
    runs = [drawing_of(folder).load_run(Path(folder)) for folder in folders]
    arrays: Arrays = {}
    if kind in VEHICLES:
        arrays = draw_vehicles(VEHICLES[kind], *runs)
    elif kind == "ranging":
        arrays = draw_bank(runs[0]) | draw_observer(runs[1])
    else:
        for name, run in zip(("body", "arm", "tracking"), runs, strict=True):
            arrays |= draw_mechanism(name, run)
    np.savez(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
