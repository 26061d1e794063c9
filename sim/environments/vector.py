"""Vector environment of ``safe-flight``: many missions at once, as a ``gymnasium.vector.VectorEnv``.

    import gymnasium, mathnavi.sim.environments
    envs = gymnasium.make_vec("mathnavi/SafeFlight-v1", num_envs=256, terrain="jacksboro")

Row i is the environment ``gymnasium.make("mathnavi/SafeFlight-v1", seed=seed + i, ...)``: the same missions, noise and
gusts, and, up to rounding, the same observations and rewards. Readings, gusts and rewards are computed for all rows
at once; the vehicles move along exact arcs (``vector_kernels``), and by MuJoCo where one may touch the ground.

When an episode ends, the next begins in the same step: ``final_obs`` and ``final_info`` hold its last values, as in
Gymnasium's ``AutoresetMode.SAME_STEP``. ``missions`` is the number of different missions, which the rows share
in turn: ``num_envs`` if not given. With a ``target`` they share one cost-to-go, and are built in a fraction of the
time.

Supported are readings of the full state at every control step, with noise and gusts. Other estimators, lost
readings, jumps and targets that move are refused: ``vectorization_mode="async"`` supports them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from mathnavi.controllers.flight.cost_to_go import FactoredCost
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.dynamics import HULL_RADIUS
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.input_bounds import ROUND_OFF
from mathnavi.sim.engine.loop import whole_ticks
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.engine.sensing import mounted
from mathnavi.sim.environments.episode_runner import EpisodeRunner, Observation, drawn_seed
from mathnavi.sim.environments.gym import LearningEnv
from mathnavi.sim.environments.learning import END_COSTS
from mathnavi.sim.environments.vector_kernels import (
    ARRIVED,
    CRASHED,
    FLYING,
    LATE,
    NEAR,
    OFF_MAP,
    Ground,
    Integers,
    Rows,
    Rules,
    fly,
    gusts_on,
    is_violated,
    state_after,
)
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.flight_learning import FlightTerms, cost_at_start, cost_to_go
from mathnavi.sim.scenarios.flight_view import components, flight_views
from mathnavi.sim.scenarios.safe_flight import VEHICLE
from mathnavi.sim.scenarios.task import Outcome

_OUTCOMES = {
    FLYING: "", ARRIVED: Outcome.ARRIVED, OFF_MAP: Outcome.OFF_MAP, CRASHED: Outcome.CRASHED, LATE: Outcome.LATE,
}  # fmt: skip
_COSTS = np.array([0.0 if state in (FLYING, NEAR) else END_COSTS[Outcome(_OUTCOMES[state])] for state in range(6)])
_NAMES = np.array([str(_OUTCOMES.get(state, "")) for state in range(6)], dtype=object)


@dataclass(frozen=True, eq=False)
class _Mission:
    """Data of a mission for its rows."""

    flight: FlightMission  # as known at the start
    cost: FactoredCost
    deadline: float  # [s]

    @staticmethod
    def from_terms(terms: FlightTerms) -> _Mission:
        flight = terms.missions[VEHICLE]
        return _Mission(flight, cost_to_go(flight), terms.deadline)


@dataclass(frozen=True, eq=False)
class _Chance:
    """Random generators of an episode, used as by the plant of a single environment."""

    noise: np.random.Generator  # of the full-state sensor
    gusts: np.random.Generator

    @staticmethod
    def from_seed(runner: EpisodeRunner, seed: int) -> _Chance:
        streams, plant = runner.streams(seed), runner.plant
        own = streams["sensing"].spawn(1)[0]  # of the plant's only vehicle
        sensors = mounted(VEHICLE, plant.sensors(VEHICLE), plant.dt, own)
        noise = next(each.rng for each in sensors if each.sensor.name == "full_state")
        return _Chance(noise, streams["gusts"])


class _Contacts:
    """Simulator of control steps of one vehicle by MuJoCo, in a model without others."""

    def __init__(self, plant: MujocoPlant, h: float) -> None:
        self._model, self._data = plant.model, mujoco.MjData(plant.model)
        self._ticks = whole_ticks(h, plant.dt, "the control period")
        self._body = int(plant.model.jnt_bodyid[0])

    def step(self, x: Array, u: Array, gust: Array) -> bool:
        """Advance the state x (6,) in place under u and a gust (3,) [m/s^2]; True if it touches."""
        data, touched = self._data, False
        mujoco.mj_resetData(self._model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = x[:3], x[3:], u
        data.xfrc_applied[self._body, :3] = gust  # its mass is 1 kg
        for _ in range(self._ticks):
            mujoco.mj_step(self._model, data)
            touched |= data.ncon > 0
        x[:3], x[3:] = data.qpos, data.qvel
        return touched


class SafeFlightVectorEnv(VectorEnv[Observation, Array, Array]):
    """Vector environment for learning of missions of ``safe-flight``, one row each."""

    metadata: dict[str, Any] = {  # noqa: RUF012  as Gymnasium declares it
        "render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP
    }  # fmt: skip

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str = "safe-flight",
        seed: int = 0,
        hold: float | None = None,
        discount: float = 1.0,
        missions: int | None = None,
        **fields: Any,
    ) -> None:
        """Build ``num_envs`` rows; the missions are drawn from ``seed`` on. The rest is as of a ``LearningEnv``.

        Raises ArgumentError for fields that are unknown, wrong, or not supported for many rows.
        """
        count = num_envs if missions is None else missions
        for what, number in (("num_envs", num_envs), ("missions", count)):
            if isinstance(number, bool) or not isinstance(number, int) or number < 1:
                raise ArgumentError(f"{what} = {number!r}; allowed: a whole number >= 1")
        self.num_envs, self.render_mode = num_envs, None
        refused = sorted(
            name for name in fields if name.partition(".")[0] in ("estimator", "covariance", "render_mode")
        )
        if refused:
            raise ArgumentError(_refusal(refused[0], fields[refused[0]]))
        first = LearningEnv(scenario, seed, hold=hold, discount=discount, **fields)
        runner = first.episode
        plant = _checked_plant(runner)
        terms = _flight_terms(runner)
        others = (EpisodeRunner(RunSpec.of(scenario, seed + k, fields=fields)) for k in range(1, min(count, num_envs)))
        made = [_Mission.from_terms(terms), *(_Mission.from_terms(_flight_terms(other)) for other in others)]
        self._missions = [made[k % len(made)] for k in range(num_envs)]
        self.single_action_space, self.single_observation_space = first.action_space, first.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._runner, self._discount, self._hold = runner, float(discount), first.hold
        self._h = runner.period / runner.control_steps
        self._steps = whole_ticks(first.hold, self._h, "hold")
        self._made = np.zeros(num_envs, dtype=np.int64)  # control steps of the last hold
        self._ground, self._contacts = terms.ground, _Contacts(plant, self._h)
        self._steepest = _steepest(terms.ground)
        self._targets = np.array([mission.flight.target for mission in self._missions])
        self._starts = np.array([mission.flight.start_state for mission in self._missions])
        deadlines = np.array([mission.deadline for mission in self._missions])
        self._deadlines = deadlines
        self._last = np.ceil((deadlines - TIME_TOLERANCE) / self._h).astype(np.int64)
        self._scale = terms.cost_max * deadlines  # the most that a whole episode can cost
        self._violated = np.zeros(num_envs, dtype=np.int64)  # those of them at whose end a bound was not kept
        flight, self._cost_max = terms.missions[VEHICLE], terms.cost_max
        self._limits = flight.clearance_min, flight.speed_max
        self._beta = terms.cost_max - flight.acceleration_max**2
        self._seeders = [seeding.np_random(None)[0] for _ in range(num_envs)]
        self._chance: dict[int, _Chance] = {}  # by row, where anything is drawn
        self._x = self._starts.copy()
        self._done = np.zeros(num_envs, dtype=np.int64)
        self._potential = np.zeros(num_envs)
        self._gusts, self._blowing = np.zeros((num_envs, 3)), np.zeros(num_envs, dtype=bool)
        self._clipped = np.zeros(num_envs, dtype=bool)
        self._read = self._starts.copy()
        self._begun = False

    @property
    def hold(self) -> float:
        """Time [s] for which an action is held."""
        return self._hold

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode in every row; ``seed`` is that of the first row, plus one for each next row, or a list."""
        if isinstance(seed, int):
            given: list[int | None] = [seed + i for i in range(self.num_envs)]
        else:
            given = [None] * self.num_envs if seed is None else list(seed)
        if len(given) != self.num_envs:
            raise ArgumentError(f"seed holds {len(given)} seeds; allowed: {self.num_envs}")
        for i, own in enumerate(given):
            if own is not None:
                self._seeders[i] = seeding.np_random(own)[0]
        seeds = self._restart(np.arange(self.num_envs))
        self._begun = True
        every = np.ones(self.num_envs, dtype=bool)
        info = self._info(np.full(self.num_envs, FLYING), [()] * self.num_envs)
        return self._observation(), {**info, "seed": seeds, "_seed": every}

    def step(self, actions: Array) -> tuple[Observation, Array, Array, Array, dict[str, Any]]:
        """Hold an action (num_envs, 3) in every row.

        Raises ValueError for another shape, for values that are not finite, and before ``reset``.
        """
        if not self._begun:
            raise ArgumentError("no episode has begun; allowed: after reset()")
        u, events = self._bounded(actions)
        begun = self._done.copy()
        states = self._fly(u)
        ended = states != FLYING
        rate = np.square(u).sum(axis=1) + self._beta
        kept = self._done - begun - self._violated
        cost = (rate * kept + self._cost_max * self._violated) * self._h
        before, self._potential = self._potential, np.where(ended, 0.0, self._phi())
        rewards = -cost / self._scale + self._discount * self._potential - before - _COSTS[states]
        for i in np.flatnonzero(states == CRASHED):
            events[i] = (*events[i], "ground-contact")
        self._observe()
        info = self._info(states, events)
        if ended.any():
            info |= self._next(np.flatnonzero(ended), info)
        return self._observation(), rewards, ended, np.zeros(self.num_envs, dtype=bool), info

    # ---- a step

    def _bounded(self, actions: Array) -> tuple[Array, list[tuple[str, ...]]]:
        """Return the accelerations (n, 3) clipped to their bounds, and events where clipping begins."""
        u = np.array(actions, dtype=np.float64)
        if u.shape != (self.num_envs, 3):
            raise ArgumentError(f"actions have shape {u.shape}; allowed: {(self.num_envs, 3)}")
        if not np.isfinite(u).all():
            where = int(np.argwhere(~np.isfinite(u))[0, 0])
            raise ArgumentError(f"actions[{where}] = {u[where].tolist()}; allowed: finite numbers")
        box = self.single_action_space
        assert isinstance(box, spaces.Box)
        u = np.clip(u, box.low, box.high)
        longest, lengths = float(box.high[0]), np.sqrt(np.einsum("ij,ij->i", u, u))
        beyond = lengths > longest
        u[beyond] *= (longest / lengths[beyond])[:, np.newaxis]
        clipped = lengths > longest * (1.0 + ROUND_OFF)
        begins, self._clipped = clipped & ~self._clipped, clipped
        return u, [("input-clipped",) if begin else () for begin in begins]

    def _fly(self, u: Array) -> Integers:
        """Advance every row; return the states of the rows, ``FLYING`` or how they ended."""
        made, violated, limits = self._made, self._violated, self._limits
        made[:] = violated[:] = 0
        states = np.full(self.num_envs, FLYING, dtype=np.int64)
        gusts, ground = self._drawn_gusts(), self._ground
        radius = self._missions[0].flight.arrival_radius
        below = Ground(ground.z, ground.spacing, HULL_RADIUS, self._steepest)
        rules = Rules(self._h, radius, limits)
        rows = Rows(self._x, self._targets, self._last, self._done, made, violated, states)
        while True:
            fly(below, rules, rows, u, gusts)
            near = np.flatnonzero(states == NEAR)
            if not len(near):
                return states
            for i in near:
                touched = self._contacts.step(self._x[i], u[i], gusts[i, made[i]])
                made[i] += 1
                self._done[i] += 1
                violated[i] += is_violated(ground.z, ground.spacing, self._x[i], limits)
                after = state_after(
                    ground.width, ground.depth, self._x[i], self._targets[i], radius, self._done[i], self._last[i]
                )
                states[i] = CRASHED if touched and after != OFF_MAP else after

    def _drawn_gusts(self) -> Array:
        """Return gusts (n, steps, 3) [m/s^2]."""
        faults = self._runner.config.faults
        if faults.gust_rms == 0.0:
            return np.zeros((self.num_envs, self._steps, 3))
        fresh = np.array([self._chance[i].gusts.standard_normal((self._steps, 3)) for i in range(self.num_envs)])
        keep = float(np.exp(-self._h / faults.gust_time_constant))
        stir = faults.gust_rms * float(np.sqrt(1.0 - keep * keep))
        return gusts_on(self._gusts, self._blowing, fresh, keep, stir, faults.gust_rms, faults.gust_limit)

    def _phi(self) -> Array:
        """Return Phi (n,) of the present states."""
        left = np.empty(self.num_envs)
        for cost, rows in self._rows.items():
            left[rows] = cost(self._x[rows, :3])
        return -left / self._first_costs

    @cached_property
    def _rows(self) -> Mapping[FactoredCost, Integers]:
        """Return the rows grouped by cost-to-go."""
        rows: dict[FactoredCost, list[int]] = {}
        for i, mission in enumerate(self._missions):
            rows.setdefault(mission.cost, []).append(i)
        return {cost: np.array(of_cost) for cost, of_cost in rows.items()}

    @cached_property
    def _first_costs(self) -> Array:
        """Return Psi (n,) of the starts."""
        return np.array([cost_at_start(mission.cost, mission.flight.start) for mission in self._missions])

    # ---- observations

    def _observe(self) -> None:
        """Read the full states with their noise: one reading for each control step; the last is the estimate."""
        noise = self._runner.config.noise.position
        self._read = self._x.copy()
        if noise > 0.0:
            width = np.sqrt(3.0) * noise
            for i, chance in self._chance.items():
                self._read[i, :3] += chance.noise.uniform(-width, width, (self._steps, 3))[self._made[i] - 1]

    def _observation(self) -> Observation:
        return self._observed(np.arange(self.num_envs))

    def _observed(self, rows: Integers) -> Observation:
        """Return the observations of some rows."""
        flight = self._missions[0].flight
        views = components(flight_views(flight.terrain, flight.speed_max, self._read[rows], self._targets[rows]))
        left = np.maximum(self._deadlines[rows] - self._done[rows] * self._h, 0.0)
        return {"time_left": left[:, np.newaxis], **views, "status": np.zeros(len(rows), dtype=np.int64)}

    def _info(self, states: Integers, events: list[tuple[str, ...]]) -> dict[str, Any]:
        every = np.ones(self.num_envs, dtype=bool)
        happened = np.empty(self.num_envs, dtype=object)
        for i, of_row in enumerate(events):
            happened[i] = of_row
        clearance = self._x[:, 2] - self._ground.height(self._x[:, 0], self._x[:, 1])
        return {
            "outcome": _NAMES[states], "_outcome": every, "events": happened, "_events": every,
            "clearance": clearance, "_clearance": every,
        }  # fmt: skip

    # ---- the next episode

    def _next(self, rows: Integers, info: dict[str, Any]) -> dict[str, Any]:
        """Begin the next episode in some rows; return ``info`` of the last step of the old and of the first of the new
        ones.
        """
        last = self._observed(rows)
        observations, mask = np.full(self.num_envs, None, dtype=object), np.zeros(self.num_envs, dtype=bool)
        for k, i in enumerate(rows):
            observations[i] = {name: value[k] for name, value in last.items()}
        mask[rows] = True
        final = {name: value.copy() for name, value in info.items() if not name.startswith("_")}
        final |= {f"_{name}": mask.copy() for name in list(final)}
        seeds = np.zeros(self.num_envs, dtype=np.int64)
        seeds[rows] = self._restart(rows)
        states = np.full(self.num_envs, FLYING)
        events = [() if mask[i] else each for i, each in enumerate(info["events"])]
        return {
            **self._info(states, events), "seed": seeds, "_seed": mask.copy(),
            "final_obs": observations, "_final_obs": mask, "final_info": final, "_final_info": mask.copy(),
        }  # fmt: skip

    def _restart(self, rows: Integers) -> Integers:
        """Begin an episode in some rows; return their seeds."""
        seeds = np.array([drawn_seed(self._seeders[i]) for i in rows], dtype=np.int64)
        config = self._runner.config
        if config.noise.position > 0.0 or config.faults.gust_rms > 0.0:
            for i, seed in zip(rows.tolist(), seeds, strict=True):
                self._chance[i] = _Chance.from_seed(self._runner, int(seed))
        self._x[rows] = self._read[rows] = self._starts[rows]
        if config.noise.position > 0.0:
            width = np.sqrt(3.0) * config.noise.position
            for i in rows.tolist():
                self._read[i, :3] += self._chance[i].noise.uniform(-width, width, 3)
        self._done[rows] = 0
        self._blowing[rows] = self._clipped[rows] = False
        self._potential[rows] = -1.0
        return seeds


def _refusal(name: str, value: Any) -> str:
    return (
        f"{name} = {value!r} is not computed for many missions at once; allowed: its default, or "
        'vectorization_mode="async"'
    )


def _flight_terms(runner: EpisodeRunner) -> FlightTerms:
    terms = runner.terms
    assert isinstance(terms, FlightTerms)
    return terms


def _checked_plant(runner: EpisodeRunner) -> MujocoPlant:
    """Return the plant of a mission; ArgumentError for fields that are not supported for many rows at once."""
    config = runner.config
    for name, value in (
        ("target_path", config.target_path),
        ("faults.dropout_rate", config.faults.dropout_rate),
        ("faults.position_jump", config.faults.position_jump),
    ):
        if value:
            raise ArgumentError(_refusal(name, value))
    plant = runner.plant.plant if isinstance(runner.plant, Disturbed) else runner.plant
    assert isinstance(plant, MujocoPlant)
    return plant


def _steepest(terrain: HeightField) -> float:
    """Return the slope of the steepest triangle."""
    east, north = np.diff(terrain.z, axis=1), np.diff(terrain.z, axis=0)
    below_diagonal, above_diagonal = np.hypot(east[:-1], north[:, 1:]), np.hypot(east[1:], north[:, :-1])
    return float(max(below_diagonal.max(), above_diagonal.max())) / terrain.spacing
