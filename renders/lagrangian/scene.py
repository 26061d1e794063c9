"""A mechanism drawn by MuJoCo, with its estimate as a ghost, and both velocities as arrows.

The model is the one that moved. The ghost is where the estimate has it, its errors drawn larger than they are. The
arrows are those of one point, the tip of the last body; of a body on a ball joint they are its rate of turning.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.entity import build_spec
from mathnavi.renders.framing import Box, framing
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.tip import Tip
from mathnavi.renders.lagrangian.views import AZIMUTH, ELEVATION, RECENT, azimuth
from mathnavi.renders.overlay import Label
from mathnavi.renders.palette import COLOURS, Picture, SceneElement
from mathnavi.renders.stage import Optics, Stage, Staged, set_size

OPTICS = Optics(28.0, 0.02, 40.0)
FREE = Box(0.12, 0.96, 0.15, 0.67)  # of a picture, in which all may move
WIDE, FREE_IN_WIDE = 1.5, Box(0.32, 0.92, 0.12, 0.88)  # width over height, from which on words are beside that
GROUPS = (0, 1, 2)  # of geoms that MuJoCo shows
SAMPLES = 60  # of the run, for what moves to be in the picture
MERGED, FAINT, SHOWN = 0.25, 0.08, 0.42  # drawn error at which a ghost is clear; opacity merged and clear
REFERENCE_SHOWN = 0.30  # likewise; where a body is on its reference, that is not seen
ARROW, TURNING = 0.42, 0.62  # of the size of the scene: the fastest velocity, of the tip or of a body that turns
THICK, THIN = 0.020, 0.010  # of the size of the scene: radii of the arrows
HULL = 1.08  # of a ghost: how much larger it is, so that where it lies on the truth it is a hull around it
PATH_POINTS = 160
PATH_WIDTH = 3.2  # [pixels] at a picture 720 pixels high
BULK = 0.6  # of the sphere around a geom that it fills, more or less


class MechanismScene(Staged):
    """Scene as a context manager, see ``Staged``."""

    def __init__(self, run: LagrangianRun, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        self.run = run
        assert run.mechanism is not None
        spec = build_spec(run.mechanism)
        set_size(spec, width, height, samples)
        self._light(spec)
        self.model = spec.compile()
        self.stage = Stage(self.model, width, height, glow=0.25)
        moves = self.model.body_weldid != 0
        self._bodies = np.flatnonzero(moves)
        self._geoms = {int(b): frozenset(np.flatnonzero(self.model.geom_bodyid == b).tolist()) for b in self._bodies}
        self._moving = [g for geoms in self._geoms.values() for g in geoms]
        self._tip = Tip(self.model, is_ball=run.is_ball)
        self._ghost = self._tip.data
        places = [self._reached(float(t)) for t in np.linspace(0.0, run.duration, SAMPLES)]
        points = np.vstack(places)
        box, sight = FREE_IN_WIDE if width > WIDE * height else FREE, (azimuth(run), ELEVATION)
        self._view = framing(points, box, OPTICS.field_of_view, width / height, sight)
        self._size = float(np.ptp(points, axis=0).max())
        speeds = [
            np.linalg.norm(self._tip.velocity(run.log.x[run.index(t)])) for t in np.linspace(0.0, run.duration, 400)
        ]
        self._scale = (TURNING if run.is_ball else ARROW) * self._size / max(float(np.max(speeds)), 1e-9)

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]."""
        stage = self.stage
        stage.look(self._view, OPTICS, GROUPS)
        stage.data.qpos[:] = self.run.position(t)
        stage.begin(fog=False, shadows=True)
        self._add_path(t)
        self._add_arrow(self.run.log.x[self.run.index(t)], SceneElement.TRUE_VELOCITY, THIN, 1.0)
        self._add_ghosts(t)
        return stage.end(sky=False)

    def labels(self, t: float, camera: str) -> list[Label]:
        """Return no labels: the legend names all elements."""
        return []

    def _add_ghosts(self, t: float) -> None:
        """Add ghosts of the reference and of the estimate, with the estimated velocity."""
        run = self.run
        if (reference := run.reference(t)) is not None:
            apart = float(run.manifold.distance(run.position(t), reference))
            self._add_ghost(reference, SceneElement.REFERENCE, REFERENCE_SHOWN * min(apart / MERGED, 1.0))
        k = run.belief(t)
        if k >= 0:
            error = run.apart(k)
            clear = 1.0 if error is None else min(run.magnification * float(np.abs(error).max()) / MERGED, 1.0)
            self._add_ghost(run.drawn(k), SceneElement.ESTIMATE, FAINT + (SHOWN - FAINT) * clear)
            found = np.concatenate([run.truth[k, : run.manifold.size], run.velocity[1][k]])
            if np.isfinite(found).all():
                self._add_arrow(found, SceneElement.FOUND_VELOCITY, THICK, 0.45)

    def _light(self, spec: Any) -> None:
        """Turn the lights with the camera of a mechanism: what is near the ends of shadows flickers."""
        turn = math.radians(azimuth(self.run) - AZIMUTH)
        c, s = math.cos(turn), math.sin(turn)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        for light in spec.worldbody.lights:
            light.pos = spec.stat.center + rotation @ (light.pos - spec.stat.center)
            light.dir = rotation @ light.dir

    # ---- what is added

    def _add_ghost(self, position: Array, part: SceneElement, opacity: float) -> None:
        """Add a copy of what moves, at a position (nq,)."""
        data = self._ghost
        data.qpos[:] = position
        mujoco.mj_kinematics(self.model, data)
        for b, geoms in self._geoms.items():
            true, ghost = (d.xmat[b].reshape(3, 3) for d in (self.stage.data, data))
            rotation = ghost @ true.T
            shift = data.xpos[b] - rotation @ self.stage.data.xpos[b]
            self.stage.copy(geoms, rotation, shift, (*COLOURS[part], opacity), HULL)

    def _add_arrow(self, state: Array, part: SceneElement, radius: float, opacity: float) -> None:
        """Add an arrow for the velocity in a state (nq + nv,)."""
        velocity = self._tip.velocity(state)
        start = self._tip.origin
        self.stage.arrow(start, start + self._scale * velocity, radius * self._size, COLOURS[part], opacity)

    def _add_path(self, t: float) -> None:
        """Add the recent path of the tip."""
        times = np.linspace(max(t - RECENT, 0.0), t, PATH_POINTS)
        places = []
        for s in times:
            self._tip.put(self.run.position(float(s)))
            places.append(self._tip.place)
        if float(np.ptp(np.array(places), axis=0).max()) > 1e-3:
            self.stage.line(np.array(places), COLOURS[SceneElement.TRUE_PATH], PATH_WIDTH)

    # ---- where things are

    def places(self, position: Array) -> Array:
        """(m, 3) [m] the middles of all geoms that move, at a position (nq,)."""
        self._ghost.qpos[:] = position
        mujoco.mj_kinematics(self.model, self._ghost)
        middles: Array = self._ghost.geom_xpos[self._moving]
        return middles.copy()

    def _reached(self, t: float) -> Array:
        """(m, 3) [m] points around all geoms that move, at ``t`` [s]."""
        middles, reach = self.places(self.run.position(t)), BULK * self.model.geom_rbound[self._moving, None]
        return np.vstack([middles - reach, middles + reach, self._ghost.xpos[self._bodies]])
