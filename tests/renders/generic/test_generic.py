"""A scenario without a drawing of its own: its scene is recorded, drawn, and refused where it is forged."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array, Estimate, Event, Plan
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.film import Frame
from mathnavi.renders.generic.drawing import BOARD, SCENE_CAMERAS
from mathnavi.renders.generic.run_data import GenericRun, load_run
from mathnavi.renders.generic.scene import generic_scene
from mathnavi.renders.report import write_report
from mathnavi.renders.scene.bodies import body_surfaces
from mathnavi.renders.scene.mujoco import MujocoScene
from mathnavi.renders.video import STILL_SAMPLES
from mathnavi.renders.web.document import packed
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.engine.scene_record import scene_arrays, shapes
from mathnavi.sim.records.run_folder import SCENE, read_scene, write_run
from tests.renders.drawn import draw_here, needs_opengl
from tests.renders.reading import checked_report

MODEL = """
<mujoco>
  <asset>
    <mesh name="keel" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
    <hfield name="shore" nrow="2" ncol="3" size="4 4 1 0.1" elevation="0 1 0 1 0 1"/>
    <material name="red" rgba="0.9 0.1 0.1 1"/>
    <texture name="tiles" type="2d" builtin="checker" rgb1="0.2 0.4 0.6" rgb2="0.4 0.6 0.8" width="512" height="64"/>
    <material name="tiles" texture="tiles" texrepeat="0.5 0.25" texuniform="true"/>
  </asset>
  <worldbody>
    <geom type="plane" size="0 0 1" contype="0" conaffinity="0" material="tiles"/>
    <geom type="hfield" hfield="shore" pos="0 20 0"/>
    <camera name="pier" pos="5 -12 4" xyaxes="1 0 0 0 0.3 1" fovy="60"/>
    <camera name="../../../out" pos="0 0 9"/>
    <body name="cart/hull" pos="0 0 1">
      <camera name="cart/bow" pos="1 0 0" xyaxes="0 -1 0 0 0 1"/>
      <joint name="cart/x" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.6 0.4 0.3" material="red" mass="1"/>
      <geom type="mesh" mesh="keel" pos="0 0 0.3" mass="0.1"/>
      <body name="cart/mast" pos="0 0 0.3">
        <joint name="cart/turn" type="hinge" axis="0 0 1"/>
        <geom type="capsule" size="0.05" fromto="0 0 0 0 0 1" mass="0.1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="cart/force" joint="cart/x"/></actuator>
</mujoco>
"""
T = np.linspace(0.0, 2.0, 41)
STATES = ("position_x [m]", "position_turn [rad]", "velocity_x [m/s]", "velocity_turn [rad/s]")
CONFIG = {"scenario": "lake:Crossing", "seed": 2, "fields": {}, "controller": {"name": "a.b:Helm", "fields": {}}}


def recording(x: Array) -> Recording:
    agent = AgentRecorder("cart", [Event(0.5, "cart", "late", "a plan")], np.ones((len(T), 1)), {})
    for t, state in zip(T, x, strict=True):
        agent.estimate(Estimate(t, np.add(state, (0.5, 0.1, 0.0, 0.0))))
    agent.adopted(0.0, Plan(np.array([0.0, 3.0]), np.vstack([x[0], x[-1] + 1.0]), np.ones((1, 1)), np.zeros(1, int)))
    return Recording(T, {"cart": x}, {"cart": agent}, agent.events, {"cart": STATES}, len(T))


def moved() -> Array:
    return np.column_stack([5.0 * T, T, np.full_like(T, 5.0), np.ones_like(T)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a cart with a mast, past a field of heights."""
    plant = MujocoPlant(
        mujoco.MjModel.from_xml_string(MODEL), {"cart": VehicleSetup(np.zeros(4))}, np.random.default_rng(0)
    )
    place, record = tmp_path_factory.mktemp("run"), recording(moved())
    write_run(place, CONFIG, {"arrived": True, "path_length_m": 10.0}, record, scene_arrays(plant, record))
    return place


def test_the_scene_holds_every_shape_and_where_it_was(folder: Path) -> None:
    run = load_run(folder)
    assert run.scene is not None
    a = run.scene.arrays
    np.testing.assert_allclose(a["pos"][:, 1, 0], 5.0 * run.scene.t, atol=1e-5)
    np.testing.assert_allclose(a["estimate.pos"][:, 1, 0], 5.0 * run.scene.t + 0.5, atol=1e-5)
    assert len(a["geom.type"]) == 5
    assert a["geom.rgba"][2].tolist() == pytest.approx([0.9, 0.1, 0.1, 1.0])
    (plan,) = (lines for lines in generic_scene(run).lines if lines.cut == "ahead")
    (ahead,) = plan.at(1.5)
    np.testing.assert_allclose(ahead[:, 0], [5.5, 11.0])
    assert drawing_of(folder).cameras == (
        *SCENE_CAMERAS,
        "pier",
        "cart-bow",
        BOARD,
    )


def test_a_floor_has_its_own_picture_and_a_page_the_cameras_of_the_model(folder: Path) -> None:
    scene = generic_scene(load_run(folder))
    (floor,) = (each for each in scene.surfaces if each.checker > 0.0)
    assert (floor.tiled, floor.picture_box) == (True, (0.0, 0.0, 2.0, 4.0))
    picture = np.asarray(Image.open(io.BytesIO(floor.picture)))
    assert picture.shape[1] <= 256
    assert {tuple(pixel) for pixel in picture.reshape(-1, 3).tolist()} == {(51, 102, 153), (102, 153, 204)}
    assert {"pier", "cart/bow"} <= {camera["name"] for camera in packed(scene)["cameras"]}


def test_a_floor_of_one_colour_keeps_it() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom type="plane" size="1 1 1" rgba="0.2 0.3 0.4 1"/></worldbody></mujoco>"""
    )
    still = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
    (floor,) = body_surfaces(shapes(model), {}, still, endless=10.0)
    assert (floor.colour, floor.tiled) == ((0.2, 0.3, 0.4), False)


@needs_opengl
def test_each_camera_shows_the_vehicle(folder: Path) -> None:
    cameras = [*SCENE_CAMERAS, "pier", BOARD]
    frames = [Frame(t, camera, 0.0, 0.0) for camera in cameras for t in (0.2, 1.8)]
    pictures = np.array(list(draw_here(folder, frames, 480, 270, STILL_SAMPLES)), dtype=int)
    for camera, (first, second) in zip(cameras, pictures.reshape(-1, 2, 270, 480, 3), strict=True):
        assert first.std() > 10.0, camera
        assert (np.abs(first - second).max(axis=-1) > 40).sum() > 30, camera  # what moves is seen to move
        if camera != BOARD:
            red, green, blue = second.reshape(-1, 3).T
            assert ((red > green + 60) & (red > blue + 60)).sum() > 30, camera  # the red hull


def test_a_run_of_numbers_alone_has_its_board_and_a_report_that_says_how_it_is_repeated(tmp_path: Path) -> None:
    write_run(tmp_path, CONFIG, {"arrived": True}, recording(moved()))
    assert drawing_of(tmp_path).cameras == (BOARD,)
    source, page = checked_report(tmp_path)
    assert "position x" in page.text
    assert "<image" not in source
    assert "--trust" in source  # its code is not installed
    assert {frame.camera for frame in drawing_of(tmp_path).frames(load_run(tmp_path))} == {BOARD}


def test_another_run_takes_the_former_scene_away(folder: Path, tmp_path: Path) -> None:
    (tmp_path / SCENE).write_bytes((folder / SCENE).read_bytes())
    write_run(tmp_path, CONFIG, {"arrived": True}, recording(moved()))
    assert not (tmp_path / SCENE).exists()


FORGED: dict[str, tuple[Callable[[dict[str, Array]], object], str]] = {
    "missing": (lambda a: a.pop("geom.size"), r"geom\.size is missing"),
    "shape": (lambda a: a.update(pos=a["pos"][:, :, :2]), r"pos has shape .*; allowed: 3"),
    "mesh": (lambda a: a.update({"mesh.0.faces": a["mesh.0.faces"] + 100}), "the mesh 0 is missing or not whole"),
    "field": (lambda a: a.update({"field.0.heights": np.full((2, 3), np.nan)}), "the field 0 is missing or not whole"),
    "body": (lambda a: a.update({"geom.body": a["geom.body"] + 9}), r"geom\.body holds indices that do not exist"),
    "endless": (lambda a: a.update(pos=a["pos"] * 1e30), r"pos holds values that are not finite, or beyond"),
    "turned": (lambda a: a.update({"geom.quat": 0.0 * a["geom.quat"]}), r"geom\.quat holds quaternions that are not"),
    "half": (lambda a: a.pop("estimate.quat"), r"estimate\.pos is there alone; allowed: estimate\.pos and"),
    "time": (lambda a: a.update(t=a["t"][::-1]), "t does not increase"),
    "plans": (lambda a: a.update({"plan.cart.offsets": np.array([0, 99])}), "the plans of cart do not fit together"),
    "picture": (lambda a: a.pop(next(name for name in a if name.startswith("texture."))), r"the texture \d is missing"),
    "repeated": (
        lambda a: a.update({"geom.repeat": -a["geom.repeat"]}),
        r"geom\.repeat holds numbers that are not posit",
    ),
    "texts": (lambda a: a.update(bodies=np.arange(3)), "bodies holds int64; allowed: texts"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_scene_is_refused_by_name(name: str, folder: Path, tmp_path: Path) -> None:
    forge, said = FORGED[name]
    arrays = read_scene(folder)
    assert arrays is not None
    forge(arrays)
    write_run(tmp_path, CONFIG, {}, recording(moved()), arrays)
    with pytest.raises(RunFolderError, match=f"{SCENE}: {said}"):
        load_run(tmp_path)


def test_the_tour_covers_the_run(folder: Path) -> None:
    run: GenericRun = load_run(folder)
    frames = drawing_of(folder).frames(run, fps=10)
    times = [frame.t for frame in frames]
    assert times == sorted(times)
    assert (times[0], times[-1]) == (0.0, run.duration)
    assert {frame.camera for frame in frames} == {"fixed", "track"}


@needs_opengl
def test_the_light_shines_on_the_middle_so_that_shadows_fall_there(folder: Path) -> None:
    with MujocoScene(generic_scene(load_run(folder)), 320, 180) as scene:
        scene.draw(0.0, "fixed")
        towards = scene.model.stat.center - scene.stage.data.light_xpos[0]
        direction = scene.stage.data.light_xdir[0]
        assert np.linalg.norm(np.cross(towards, direction)) < 1e-6 * np.linalg.norm(towards)


@needs_opengl
def test_bodies_cast_shadows_and_lines_and_ghosts_none(folder: Path) -> None:
    with MujocoScene(generic_scene(load_run(folder)), 320, 180) as scene:
        scene.draw(1.5, "fixed")
        drawn = scene.stage._renderer.scene
        added = [g for g in drawn.geoms[: drawn.ngeom] if g.objtype != mujoco.mjtObj.mjOBJ_GEOM]
        bodies = [g for g in added if g.type == mujoco.mjtGeom.mjGEOM_MESH and g.rgba[3] == 1.0]
        assert len(bodies) > 2
        assert {g.category for g in bodies} == {int(mujoco.mjtCatBit.mjCAT_DYNAMIC)}
        others = [g for g in added if g.type != mujoco.mjtGeom.mjGEOM_MESH or g.rgba[3] < 1.0]
        assert len(others) > 3  # path, plan and ghost
        assert {g.category for g in others} == {int(mujoco.mjtCatBit.mjCAT_DECOR)}


def test_figures_of_a_scenario_stand_in_its_summary(folder: Path, tmp_path: Path) -> None:
    write_run(tmp_path, CONFIG, {"arrived": True, "collisions": 3, "seed": 2}, recording(moved()))
    source = write_report(tmp_path).read_text(encoding="utf-8")
    assert "collisions" in source[source.index("Summary") : source.index("Do it again")]
    assert "collisions" not in source[source.index("<footer") :]


def test_a_report_shows_no_cost_of_plans_that_state_none(folder: Path, tmp_path: Path) -> None:
    record = recording(moved())
    for cost, shown in ((np.nan, False), (3.0, True)):
        agent = record.agents["cart"]
        agent.plans[:] = [(t, dataclasses.replace(plan, cost=cost)) for t, plan in agent.plans]
        write_run(tmp_path, CONFIG, {"arrived": True}, record)
        assert ("The objective of the plan" in write_report(tmp_path).read_text(encoding="utf-8")) is shown


def test_the_log_of_another_run_is_refused(folder: Path, tmp_path: Path) -> None:
    write_run(tmp_path, CONFIG, {"arrived": True}, recording(moved()))
    with np.load(tmp_path / "log.npz") as log:
        arrays = dict(log)
    arrays["truth.x"] = arrays["truth.x"][:, :2]
    np.savez(tmp_path / "log.npz", **arrays)
    with pytest.raises(RunFolderError, match=r"truth\.x has 2 states; allowed: 4, as log\.json next to it names"):
        load_run(tmp_path)
