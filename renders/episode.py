"""Pictures of an episode of an environment: MuJoCo's scene from a following camera, or the states of an ODE over time.

The environments find ``EpisodePictures`` by its entry point.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.snapshots import Snapshots
from mathnavi.renders.stage import View
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.environments.pictures import FPS, Pixels
from mathnavi.sim.scenarios.flight_learning import FlightTerms

DPI = 100.0  # of a chart
_DISTANCE = 9.0  # of the camera, in sizes of the vehicle
_AZIMUTH, _ELEVATION = 35.0, -18.0  # [degrees]


class EpisodePictures:
    """Renderer of episodes, which keeps its resources from one picture to the next."""

    def __init__(self, width: int, height: int) -> None:
        """``width`` and ``height`` of the pictures in pixels."""
        self._size = width, height
        self._snapshots: Snapshots | None = None
        self._viewer: Any = None
        self._window: Any = None
        self._shown: mujoco.MjData | None = None

    def drawn(self, episode: EpisodeRunner) -> Pixels:
        """Draw the picture (height, width, 3); NoOpenGLError if OpenGL is not available."""
        plant = _mujoco_plant(episode)
        if plant is None:
            return _chart(episode, *self._size)
        if self._snapshots is None:
            self._snapshots = Snapshots(*self._size)
        _dress(episode, plant)
        return self._snapshots.draw(plant.model, plant.data, _view(episode, plant), _ground(episode))

    def show(self, episode: EpisodeRunner) -> None:
        """Show the present state in a window, MuJoCo's viewer if MuJoCo simulates the system."""
        plant = _mujoco_plant(episode)
        if plant is None:
            self._show_chart(episode)
            return
        _dress(episode, plant)
        if self._viewer is None:
            import mujoco.viewer

            self._shown = mujoco.MjData(plant.model)  # the plant has another one in every episode
            self._viewer = mujoco.viewer.launch_passive(plant.model, self._shown)
            view = _view(episode, plant)
            for name in ("distance", "azimuth", "elevation"):
                setattr(self._viewer.cam, name, getattr(view, name))
        mujoco.mj_copyData(self._shown, plant.model, plant.data)
        self._viewer.cam.lookat[:] = _view(episode, plant).lookat
        self._viewer.sync()

    def _show_chart(self, episode: EpisodeRunner) -> None:
        import matplotlib.pyplot as plt  # takes a while to import

        if self._window is None:
            width, height = self._size
            self._window = plt.figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        self._window.clear()
        self._window.figimage(_chart(episode, *self._size))
        plt.pause(1.0 / FPS)

    def close(self) -> None:
        """End the drawing process and close the window."""
        if self._snapshots is not None:
            self._snapshots.close()
        if self._viewer is not None:
            self._viewer.close()
        if self._window is not None:
            import matplotlib.pyplot as plt

            plt.close(self._window)
        self._snapshots = self._viewer = self._window = None


def _mujoco_plant(episode: EpisodeRunner) -> MujocoPlant | None:
    """Return the plant of the present episode; None for an ODE."""
    plant = episode.present_plant
    while not isinstance(plant, MujocoPlant) and hasattr(plant, "plant"):
        plant = plant.plant
    return plant if isinstance(plant, MujocoPlant) else None


def _ground(episode: EpisodeRunner) -> HeightField | None:
    """Return the ground of a flight; None for anything else."""
    try:
        terms = episode.terms
    except ArgumentError:  # a scenario that nobody learns in
        return None
    return terms.ground if isinstance(terms, FlightTerms) else None


def _dress(episode: EpisodeRunner, plant: MujocoPlant) -> None:
    """Move the airframes, which are only drawn, to their vehicles."""
    mujoco.mj_kinematics(plant.model, plant.data)
    for name in episode.names:
        body = mujoco.mj_name2id(plant.model, mujoco.mjtObj.mjOBJ_BODY, f"{name}/airframe")
        if body < 0 or not np.isfinite(episode.truths[name]).all():
            continue
        x, acceleration = episode.truths[name], plant.data.qacc[plant.layout(name).v]
        k = int(plant.model.body_mocapid[body])
        plant.data.mocap_pos[k], plant.data.mocap_quat[k] = airframe_pose(x[:3], x[3:6], acceleration)
    mujoco.mj_kinematics(plant.model, plant.data)
    mujoco.mj_camlight(plant.model, plant.data)


def _view(episode: EpisodeRunner, plant: MujocoPlant) -> View:
    """Return a camera that keeps all vehicles in view."""
    model, data = plant.model, plant.data
    own = [
        k for k in range(model.ngeom)
        if model.body(int(model.geom_bodyid[k])).name.startswith(tuple(f"{name}/" for name in episode.names))
    ]  # fmt: skip
    centres, reach = data.geom_xpos[own], float(model.geom_rbound[own].max())
    distance = _DISTANCE * max(reach, 0.5 * float(np.ptp(centres, axis=0).max()))
    return View(centres.mean(axis=0), distance, _AZIMUTH, _ELEVATION)


def _chart(episode: EpisodeRunner, width: int, height: int) -> Pixels:
    """Draw the states over time, a picture (height, width, 3)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # takes a while to import
    from matplotlib.figure import Figure

    recording = episode.recording
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    canvas, axes = FigureCanvasAgg(figure), figure.subplots()
    for name in episode.names:
        for k, state in enumerate(recording.state_names[name]):
            axes.plot(recording.t, recording.truths[name][:, k], label=state)
    axes.set_xlabel("t [s]")
    axes.legend()
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]
