"""Batch of rollouts of a scenario's plant, by ``mujoco.batch``.

    from mathnavi.sim.environments.batch import load
    rollouts = load("safe-flight", seed=3, terrain="jacksboro")
    states = rollouts.states(starts, commands)

The physics alone, in still air: no sensors, no estimator, no gusts, no faults. A command is held for the period of the
scenario's tracker, and clipped to its bounds, as in a flight; the states are those of the loop's plant, bit for bit,
on any number of threads. Commands to a fleet have a row for each vehicle.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.loop import whole_ticks
from mathnavi.sim.engine.plant import Layout, MujocoPlant
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.records.run_spec import RunSpec


def load(scenario: str, *, seed: int = 0, threads: int = 0, **fields: Any) -> Rollouts:
    """Load the plant of a scenario with these fields and a mission drawn from ``seed``, on ``threads`` threads, 0 for
    all CPUs.

    Raises ArgumentError for an unknown scenario, for fields that are wrong, and for a scenario whose plant is not
    MuJoCo's or has delayed actuators.
    """
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 0:
        raise ArgumentError(f"threads = {threads!r}; allowed: a whole number >= 0")
    episode = EpisodeRunner(RunSpec.of(scenario, seed, fields=fields))
    plant = episode.plant.plant if isinstance(episode.plant, Disturbed) else episode.plant
    if not isinstance(plant, MujocoPlant):
        raise ArgumentError(f"scenario = {scenario!r} with these fields is an ODE; allowed: one that MuJoCo moves")
    layouts = [plant.layout(name) for name in episode.names]
    if late := [layout.delay for layout in layouts if layout.delay]:
        raise ArgumentError(f"actuators of {scenario!r} are {late[0]} ticks late; allowed: 0")
    return Rollouts(plant, episode, layouts, threads)


class Rollouts:
    """Batch of N runs of a plant."""

    def __init__(self, plant: MujocoPlant, episode: EpisodeRunner, layouts: list[Layout], threads: int) -> None:
        self._plant, self._layouts, self._threads = plant, layouts, threads
        self._ticks = whole_ticks(episode.period, plant.dt, "the tracker's period")
        self._names, self.period = episode.names, episode.period
        self.start = episode.start
        """state (nx,) at the start of the mission; of a fleet (n, nx)"""

    def states(self, starts: Any, commands: Any) -> Array:
        """Return the states (N, K + 1, nx) from N starts (N, nx), and after each of K commands (N, K, nu).

        Of a fleet of n, (N, K + 1, n, nx) from (N, n, nx) and (N, K, n, nu). Activations and mocap bodies
        start as in a run.
        Raises ArgumentError for other shapes, for values that are not finite, and for a quaternion not of length 1.
        """
        x, u = np.array(starts, dtype=np.float64), np.array(commands, dtype=np.float64)
        one, input_size = self.start.shape, self._layouts[0].input_size
        if x.shape[1:] != one or not len(x):
            raise ArgumentError(f"starts has shape {x.shape}; allowed: {('N', *one)}, N >= 1".replace("'", ""))
        if u.ndim < 2 or u.shape != (len(x), u.shape[1], *one[:-1], input_size):
            allowed = f"{(len(x), 'K', *one[:-1], input_size)}".replace("'", "")
            raise ArgumentError(f"commands has shape {u.shape}; allowed: {allowed}, a sequence for each start")
        if not np.isfinite(u).all():
            where = tuple(map(int, np.argwhere(~np.isfinite(u))[0]))
            raise ArgumentError(f"commands[{where}] = {u[where]}; allowed: finite numbers")
        vehicles = len(self._names)
        x = x.reshape(len(x), vehicles, one[-1])
        u = u.reshape(len(x), u.shape[1], vehicles, input_size)
        found = self._rolled_out(x, u)
        return found.reshape(len(x), u.shape[1] + 1, *one)

    def _rolled_out(self, x: Array, u: Array) -> Array:
        """Return the states (N, K + 1, n, nx) from starts (N, n, nx) and commands (N, K, n, nu)."""
        batch = Batch(self._plant.model, len(x), self._threads)
        if self._plant.model.nkey:  # activations and mocap bodies as in a run
            batch.reset(keyframe=0, stage=int(mujoco.mjtStage.mjSTAGE_NONE))
        qpos, qvel, ctrl = (batch.bind(field) for field in ("qpos", "qvel", "ctrl"))  # views of what is stepped
        for row, states in enumerate(x):
            for name, state in zip(self._names, states, strict=True):
                self._plant.place(name, state)
            qpos[row], qvel[row] = self._plant.data.qpos, self._plant.data.qvel
        batch.forward()
        driven = any(layout.drive is not None for layout in self._layouts)
        out = np.empty((len(x), u.shape[1] + 1, *x.shape[1:]))
        self._read(qpos, qvel, out[:, 0])
        for k in range(u.shape[1]):
            held = [self._bounded(inputs) for inputs in u[:, k]]
            for _ in range(self._ticks if driven else 1):  # a drive acts before every tick
                self._act(held, qpos, qvel, ctrl)
                batch.step(nstep=1 if driven else self._ticks)
            self._read(qpos, qvel, out[:, k + 1])
        return out

    def _bounded(self, inputs: Array) -> list[Array]:
        """Clip the inputs (n, nu) of one run to their bounds."""
        return [layout.bounded(u)[0] for layout, u in zip(self._layouts, inputs, strict=True)]

    def _act(self, held: list[list[Array]], qpos: Array, qvel: Array, ctrl: Array) -> None:
        """Apply the inputs of each run and vehicle to the actuators."""
        for row, inputs in enumerate(held):
            for layout, u in zip(self._layouts, inputs, strict=True):
                control = ctrl[row, layout.actuators]
                if layout.drive is None:
                    control[:] = u
                else:
                    layout.drive.act(u, qpos[row, layout.q], qvel[row, layout.v], control, self._plant.dt)

    def _read(self, qpos: Array, qvel: Array, out: Array) -> None:
        """Return the states (N, n, nx)."""
        for k, layout in enumerate(self._layouts):
            out[:, k] = np.concatenate((qpos[:, layout.q], qvel[:, layout.v]), axis=1)
