"""Vector environment of ``safe-flight``: many missions at once, as a ``gymnasium.vector.VectorEnv``.

    import gymnasium, mathnavi.sim.environments
    envs = gymnasium.make_vec("mathnavi/SafeFlight-v1", num_envs=256, terrain="jacksboro")

Row i is the environment ``gymnasium.make("mathnavi/SafeFlight-v1", seed=seed + i, ...)``: the same missions, noise and
gusts, and, up to rounding, the same observations and rewards. Readings, gusts and rewards are computed for all rows
at once; the vehicles move along exact arcs (``vector_kernels``), and by MuJoCo where one may touch the ground.

``autoreset_mode`` says when the next episode of a row begins, as in Gymnasium's ``SyncVectorEnv``: in the step that
ends the last one (``AutoresetMode.SAME_STEP``, if not given: ``final_obs`` and ``final_info`` hold its last values), in
the step after it, whose action is ignored (``NEXT_STEP``), or when ``reset(options={"reset_mask": mask})`` begins those
of the rows of a mask (``DISABLED``). An episode is truncated after ``max_episode_steps``.

``missions`` is the number of different missions, which the rows share in turn: ``num_envs`` if not given. With a
``target`` they share one cost-to-go, and are built in a fraction of the time.

A copy, by ``pickle`` or ``copy.deepcopy``, is rebuilt from the arguments. Its next episodes are those that come next
here; it has no present ones until ``reset``.

Supported are readings of the full state at every control step, with noise and gusts. Other estimators, lost
readings, jumps and targets that move are refused: ``vectorization_mode="async"`` supports them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from mathnavi.controllers.flight.cost_to_go import FactoredCost
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.dynamics import HULL_RADIUS
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.input_bounds import ROUND_OFF
from mathnavi.sim.engine.loop import whole_ticks
from mathnavi.sim.environments.episode_runner import (
    EpisodeRunner,
    Observation,
    checked_numbers,
    drawn_seed,
    finite_squares,
)
from mathnavi.sim.environments.gym import LearningEnv
from mathnavi.sim.environments.learning import END_COSTS
from mathnavi.sim.environments.resets import checked_limit, checked_mode, reset_rows, seeds_of_rows
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
from mathnavi.sim.environments.vector_missions import (
    Chance,
    Contacts,
    Mission,
    checked_plant,
    flight_terms,
    refusal,
    steepest,
)
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.flight_learning import cost_at_start
from mathnavi.sim.scenarios.flight_view import components, flight_views
from mathnavi.sim.scenarios.safe_flight import VEHICLE
from mathnavi.sim.scenarios.task import Outcome

Mask = NDArray[np.bool_]

_OUTCOMES = {
    FLYING: "", ARRIVED: Outcome.ARRIVED, OFF_MAP: Outcome.OFF_MAP, CRASHED: Outcome.CRASHED, LATE: Outcome.LATE,
}  # fmt: skip
_COSTS = np.array([0.0 if state in (FLYING, NEAR) else END_COSTS[Outcome(_OUTCOMES[state])] for state in range(6)])
_SINGLE = ("estimator", "covariance", "render_mode", "width", "height")  # arguments of single environments only
_NAMES = np.array([str(_OUTCOMES.get(state, "")) for state in range(6)], dtype=object)


class SafeFlightVectorEnv(VectorEnv[Observation, Array, NDArray[Any]]):
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
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        max_episode_steps: int | None = None,
        **fields: Any,
    ) -> None:
        """Build ``num_envs`` rows; the missions are drawn from ``seed`` on. The rest is as of a ``LearningEnv``.

        Raises ArgumentError for fields that are unknown, wrong, or not supported for many rows.
        """
        self._arguments = dict(
            num_envs=num_envs, scenario=scenario, seed=seed, hold=hold, discount=discount, missions=missions,
            autoreset_mode=autoreset_mode, max_episode_steps=max_episode_steps, **fields,
        )  # fmt: skip
        count = num_envs if missions is None else missions
        for what, number in (("num_envs", num_envs), ("missions", count)):
            if isinstance(number, bool) or not isinstance(number, int) or number < 1:
                raise ArgumentError(f"{what} = {number!r}; allowed: a whole number >= 1")
        self.num_envs, self.render_mode = num_envs, None
        self._mode, self._limit = checked_mode(autoreset_mode), checked_limit(max_episode_steps)
        self.metadata = {**self.metadata, "autoreset_mode": self._mode}
        refused = sorted(name for name in fields if name.partition(".")[0] in _SINGLE)
        if refused:
            raise ArgumentError(refusal(refused[0], fields[refused[0]]))
        first = LearningEnv(scenario, seed, hold=hold, discount=discount, **fields)
        runner = first.episode
        plant = checked_plant(runner)
        terms = flight_terms(runner)
        others = (EpisodeRunner(RunSpec.of(scenario, seed + k, fields=fields)) for k in range(1, min(count, num_envs)))
        made = [Mission.from_terms(terms), *(Mission.from_terms(flight_terms(other)) for other in others)]
        self._missions = [made[k % len(made)] for k in range(num_envs)]
        self.single_action_space, self.single_observation_space = first.action_space, first.observation_space
        assert isinstance(first.action_space, spaces.Box)
        self._low, self._high = first.action_space.low.copy(), first.action_space.high.copy()  # a learner has the space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._runner, self._discount, self._hold = runner, float(discount), first.hold
        self._h = runner.period / runner.control_steps
        self._steps = whole_ticks(first.hold, self._h, "hold")
        self._made = np.zeros(num_envs, dtype=np.int64)  # control steps of the last hold
        self._ground, self._contacts = terms.ground, Contacts(plant, self._h)
        self._steepest = steepest(terms.ground)
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
        self._seeders = [seeding.np_random(None) for _ in range(num_envs)]  # of the episodes, with their own seeds
        self._chance: dict[int, Chance] = {}  # by row, where anything is drawn
        self._x = self._starts.copy()
        self._done = np.zeros(num_envs, dtype=np.int64)
        self._potential = np.zeros(num_envs)
        self._gusts, self._blowing = np.zeros((num_envs, 3)), np.zeros(num_envs, dtype=bool)
        self._clipped = np.zeros(num_envs, dtype=bool)
        self._read = self._starts.copy()
        self._begun = False
        self._taken = np.zeros(num_envs, dtype=np.int64)  # steps of the present episodes
        self._over = np.zeros(num_envs, dtype=np.bool_)  # rows whose episode has ended, and no other has begun

    def __getstate__(self) -> dict[str, Any]:
        return {"arguments": self._arguments, "seeders": self._seeders, "spec": self.spec}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state["arguments"])  # type: ignore[misc]
        self._seeders, self.spec = state["seeders"], state["spec"]

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Generators of the episodes' seeds, one for each row, as of a ``SyncVectorEnv``."""
        return tuple(rng for rng, _ in self._seeders)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Seeds of these generators."""
        return tuple(seed for _, seed in self._seeders)

    @property
    def hold(self) -> float:
        """Time [s] for which an action is held."""
        return self._hold

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode in every row, or in those of ``options["reset_mask"]``, (num_envs,) bool.

        ``seed`` is that of the first row, plus one for each next row, or a list; rows that go on do not use theirs.
        ``info`` is that of the rows that begin. Raises ArgumentError for options and seeds that are wrong, and changes
        nothing then.
        """
        rows, given = reset_rows(options, self.num_envs), seeds_of_rows(seed, self.num_envs)
        if not (self._begun or rows.all()):
            raise ArgumentError("options: reset_mask before any episode; allowed: after a reset() of every row")
        for i in np.flatnonzero(rows):
            if (own := given[i]) is not None:
                self._seeders[i] = seeding.np_random(own)
        seeds = self._restart(rows)
        self._begun = True
        info = self._info(np.full(self.num_envs, FLYING), [()] * self.num_envs, rows)
        return self._observation(), {**info, "seed": seeds, "_seed": rows.copy()}

    def step(self, actions: Array) -> tuple[Observation, Array, Mask, Mask, dict[str, Any]]:
        """Hold an action (num_envs, 3) in every row but those whose next episode begins, by ``NEXT_STEP``.

        Raises ValueError for another shape, for values that are not finite, before ``reset``, and by ``DISABLED``
        for a row whose episode is over.
        """
        beginning = self._checked_rows()
        u, events = self._bounded(actions, beginning)
        begun = self._done.copy()
        states = self._fly(u, beginning)
        terminated = states != FLYING
        rate = np.square(u).sum(axis=1) + self._beta
        kept = self._done - begun - self._violated
        cost = (rate * kept + self._cost_max * self._violated) * self._h
        before, self._potential = self._potential, np.where(terminated, 0.0, self._phi())
        rewards = -cost / self._scale + self._discount * self._potential - before - _COSTS[states]
        rewards[beginning] = 0.0
        self._taken += 1
        truncated = ~beginning & (self._taken >= self._limit if self._limit is not None else False)
        for i in np.flatnonzero(states == CRASHED):
            events[i] = (*events[i], "ground-contact")
        self._observe()
        begins = {"seed": self._restart(beginning), "_seed": beginning} if beginning.any() else {}
        info = self._info(states, events, np.ones(self.num_envs, dtype=np.bool_)) | begins
        over = terminated | truncated
        if self._mode is not AutoresetMode.SAME_STEP:
            self._over = over
        elif over.any():
            info = self._next(over, states, events)
        return self._observation(), rewards, terminated, truncated, info

    # ---- a step

    def _checked_rows(self) -> Mask:
        """Return the rows whose next episode begins in this step; ArgumentError for rows that cannot go on."""
        if not self._begun:
            raise ArgumentError("no episode has begun; allowed: after reset()")
        if self._mode is AutoresetMode.DISABLED and self._over.any():
            raise ArgumentError(
                f"step(): the episodes of rows {np.flatnonzero(self._over).tolist()} are over; allowed: after "
                'reset(options={"reset_mask": mask})'
            )
        return self._over.copy()

    def _bounded(self, actions: Array, ignored: Mask) -> tuple[Array, list[tuple[str, ...]]]:
        """Return the accelerations (n, 3) clipped to their bounds, zero in rows that are ignored, and events where
        clipping begins.
        """
        u = checked_numbers(actions, (self.num_envs, 3), "actions have")
        u[ignored] = 0.0
        if not finite_squares(u):
            where = next(i for i, row in enumerate(u) if not finite_squares(row))
            allowed = "finite numbers, whose squares are finite too"
            raise ArgumentError(f"actions[{where}] = {u[where].tolist()}; allowed: {allowed}")
        u = np.clip(u, self._low, self._high)
        longest, lengths = float(self._high[0]), np.sqrt(np.einsum("ij,ij->i", u, u))
        beyond = lengths > longest
        u[beyond] *= (longest / lengths[beyond])[:, np.newaxis]
        clipped = lengths > longest * (1.0 + ROUND_OFF)
        begins, self._clipped = clipped & ~self._clipped, clipped
        return u, [("input-clipped",) if begin else () for begin in begins]

    def _fly(self, u: Array, resting: Mask) -> Integers:
        """Advance every row that does not rest; return the states of the rows, ``FLYING`` or how they ended."""
        made, violated, limits = self._made, self._violated, self._limits
        made[:] = violated[:] = 0
        states = np.where(resting, LATE, FLYING)  # only rows that fly are advanced
        gusts, ground = self._drawn_gusts(), self._ground
        radius = self._missions[0].flight.arrival_radius
        below = Ground(ground.z, ground.spacing, HULL_RADIUS, self._steepest)
        rules = Rules(self._h, radius, limits)
        rows = Rows(self._x, self._targets, self._last, self._done, made, violated, states)
        while True:
            fly(below, rules, rows, u, gusts)
            near = np.flatnonzero(states == NEAR)
            if not len(near):
                states[resting] = FLYING
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

    def _info(self, states: Integers, events: list[tuple[str, ...]], rows: Mask) -> dict[str, Any]:
        """Return ``info`` of some rows, and which they are, as Gymnasium stacks it."""
        outcomes = _NAMES[states]
        outcomes[~rows] = None
        happened = np.empty(self.num_envs, dtype=object)  # of None
        for i in np.flatnonzero(rows).tolist():
            happened[i] = events[i]
        clearance = self._x[:, 2] - self._ground.height(self._x[:, 0], self._x[:, 1])
        return {
            "outcome": outcomes, "_outcome": rows.copy(),
            "events": happened, "_events": rows.copy(),
            "clearance": np.where(rows, clearance, 0.0), "_clearance": rows.copy(),
        }  # fmt: skip

    # ---- the next episode

    def _next(self, over: Mask, states: Integers, events: list[tuple[str, ...]]) -> dict[str, Any]:
        """Begin the next episode in the rows that are over; return ``info`` of the last step of the old and of the
        first of the new ones.
        """
        rows = np.flatnonzero(over)
        last = self._observed(rows)
        observations = np.full(self.num_envs, None, dtype=object)
        for k, i in enumerate(rows):
            observations[i] = {name: value[k] for name, value in last.items()}
        final = self._info(states, events, over)
        seeds = self._restart(over)
        events = [() if ended else each for each, ended in zip(events, over, strict=True)]
        return {
            **self._info(np.full(self.num_envs, FLYING), events, np.ones(self.num_envs, dtype=np.bool_)),
            "seed": seeds, "_seed": over.copy(),
            "final_obs": observations, "_final_obs": over, "final_info": final, "_final_info": over.copy(),
        }  # fmt: skip

    def _restart(self, mask: Mask) -> Integers:
        """Begin an episode in some rows; return their seeds (num_envs,), 0 in the other rows."""
        rows, seeds = np.flatnonzero(mask), np.zeros(self.num_envs, dtype=np.int64)
        seeds[rows] = [drawn_seed(self._seeders[i][0]) for i in rows]
        config = self._runner.config
        if config.noise.position > 0.0 or config.faults.gust_rms > 0.0:
            for i in rows.tolist():
                self._chance[i] = Chance.from_seed(self._runner, int(seeds[i]))
        self._x[rows] = self._read[rows] = self._starts[rows]
        if config.noise.position > 0.0:
            width = np.sqrt(3.0) * config.noise.position
            for i in rows.tolist():
                self._read[i, :3] += self._chance[i].noise.uniform(-width, width, 3)
        self._done[rows] = self._taken[rows] = 0
        self._blowing[rows] = self._clipped[rows] = self._over[rows] = False
        self._potential[rows] = -1.0
        return seeds
