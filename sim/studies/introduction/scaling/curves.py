"""Quantities that grow, their sizes, and the cost of each size: CPU time and memory of one process.

Each measurement is a job of its own. It does its work once in the smallest size, so that kernels are loaded, and then
in the size that is asked for. No map is read twice: each has a file that is new.
"""

from __future__ import annotations

import atexit
import itertools
import math
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import zoom

from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.sensors import PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.interfaces.protocols import Estimator
from mathnavi.sim.interfaces.signals import Array, Measurement
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.store import Store
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.studies.introduction.scaling.memory import PeakMemory
from mathnavi.sim.studies.ranging.estimator_runs import START, declared_mission, noisy_run
from mathnavi.sim.studies.ranging.observability_measures import STANDARD
from mathnavi.sim.sweep.execution import run_trials
from mathnavi.sim.sweep.trial import Trial, contents, trial

GROUND = "tian_shan"
FLOWN = 20.0  # [s] of a fleet's flight
SLOT_SPACING = 600.0  # [m] with which the slots of the largest fleet lie on the map
UPDATES = 200  # of an estimator
FIGURES = 40  # of a trial's summary


@dataclass(frozen=True)
class Measured:
    """Cost of one size."""

    cost: MeasuredTime  # in the unit of the curve
    memory: MeasuredTime  # [MB] that the process grew by at most; NaN where the system does not say


@dataclass(frozen=True)
class SizedCase:
    """A size of a curve."""

    curve: str
    size: int
    seed: int


@dataclass(frozen=True)
class ScalingCurve:
    """Growth of a cost with a size.

    ``cost(made(size, seed))`` is the cost; what ``made`` takes does not count. Up to ``limit`` it serves; ``today`` is
    the size that is ordinary now.
    """

    size: str
    unit: str  # of the cost
    sizes: tuple[int, ...]
    today: int
    limit: float
    because: str  # of the limit
    made: Callable[[int, int], Any]
    cost: Callable[[Any], float]
    holds: bool = False  # whether what ``made`` keeps counts as memory


def measured(case: SizedCase) -> Measured:
    """A job: the cost of one size."""
    curve = CURVES[case.curve]
    curve.cost(curve.made(curve.sizes[0], case.seed))
    memory = PeakMemory()
    with ExitStack() as watched:
        if curve.holds:
            watched.enter_context(memory)
        made = curve.made(case.size, case.seed)
        if not curve.holds:
            watched.enter_context(memory)
        cost = curve.cost(made)
    return Measured(MeasuredTime(cost), MeasuredTime(memory.grown))


# ---- flight


def _mission(seed: int, **fields: Any) -> Trial:
    return trial("safe-flight", seed, fields={"terrain": GROUND, "drawn_separation": (0.15, 0.2), **fields})


def _planned(nodes: int, seed: int) -> Trial:
    period = 5.0 / 3.0
    return _mission(seed, **{"planner.nodes": nodes, "planner.horizon": 20.0, "planner.period": period})


def _replan(flight: Trial) -> float:
    return float(flight.build().run().summary["solve_ms_mean"])


_moments = itertools.count(1)  # [s] at which files were changed last


@cache
def _folder() -> Path:
    """A folder of this process that goes with it."""
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    return Path(folder.name)


def _over_map(side: int, seed: int) -> Trial:
    """A mission over the same ground, with so many nodes along each side, in a file that no mission has read."""
    path = _folder() / f"{side}.npz"
    if not path.exists():
        ground = load_terrain(GROUND)
        nodes = ground.z.shape[0]
        z = zoom(ground.z, side / nodes, order=1)
        write_npz(HeightField(z, ground.spacing * (nodes - 1) / (side - 1), path.stem), path)
    os.utime(path, (moment := float(next(_moments)), moment))  # for a process reads a file that stays as it is once
    return _mission(seed, terrain=str(path))


def _building(flight: Trial) -> float:
    began = time.process_time()
    flight.build()
    return time.process_time() - began


def _under_radars(count: int, seed: int) -> Trial:
    ground, rng = load_terrain(GROUND), np.random.default_rng(seed)
    at = rng.uniform(0.1, 0.9, (count, 2)) * (ground.width, ground.depth)
    return _mission(seed, radar=tuple((float(x), float(y), 10_000.0, 5.0) for x, y in at))


def _loop_over_map(side: int, seed: int) -> ClosedLoop:
    return _over_map(side, seed).build()


def _fleet(vehicles: int, seed: int) -> ClosedLoop:
    fields = {"terrain": GROUND, "vehicles": vehicles, "slot_spacing": SLOT_SPACING}
    return replace(trial("simultaneous-arrival", seed, fields=fields).build(), duration=FLOWN)


def _flying(closed_loop: ClosedLoop) -> float:
    began = time.process_time()
    outcome = closed_loop.run()
    return (time.process_time() - began) / float(outcome.recording.t[-1])


# ---- estimators


@dataclass(frozen=True, eq=False)
class _Replay:
    """An estimator and what it is to be called with."""

    estimator: Estimator
    readings: Sequence[Sequence[Measurement]]
    command: Array
    period: float  # [s]


def _bank(count: int, seed: int) -> _Replay:
    """The bank, none of whose hypotheses is dropped."""
    mission = declared_mission(STANDARD, "2s")
    readings = noisy_run(mission, np.array(START), UPDATES * mission.period, np.random.default_rng(seed)).readings
    plugin = load("estimators", "feasible_set_bank")
    config = plugin.Config(hypotheses=count, candidates=max(300, 4 * count), lowest=-1e300)
    return _Replay(plugin.build(config, mission), readings, np.zeros(2), mission.period)


def _observer(joints: int, seed: int) -> _Replay:
    """The intrinsic observer of a chain of hinges."""
    path = _folder() / f"chain-{joints}.xml"
    path.write_text(_chain(joints), encoding="utf-8")
    system = MechanismSystem(build_model(str(path), name="chain"))
    mission = LagrangianMission(system, PositionQuality(1e-4), 1e-3, speed_max=30.0)
    rng, x, command = np.random.default_rng(seed), mission.start_state, np.full(joints, 0.01)
    readings = []
    for k in range(UPDATES):
        y = x[:joints] + mission.reading.noise * rng.standard_normal(joints)
        readings.append((Measurement("position", k * mission.period, y),))
        x = mission.flow(x, command, mission.period)
    plugin = load("estimators", "riemannian_observer")
    return _Replay(plugin.build(plugin.Config(), mission), readings, command, mission.period)


def _chain(joints: int) -> str:
    """MJCF of a chain of ever lighter links, about two axes by turns."""
    opened = "".join(
        f'<body pos="0 0 {0.0 if k == 0 else -0.2}"><joint name="j{k}" type="hinge" axis="{k % 2} {1 - k % 2} 0"/>'
        f'<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="{0.9**k:.6g}" contype="0" conaffinity="0"/>'
        for k in range(joints)
    )
    motors = "".join(f'<motor name="m{k}" joint="j{k}"/>' for k in range(joints))
    return f"<mujoco><worldbody>{opened}{'</body>' * joints}</worldbody><actuator>{motors}</actuator></mujoco>"


def _updating(replay: _Replay) -> float:
    """[us] the median of an update, of those after the first quarter."""
    taken = []
    for k, read in enumerate(replay.readings):
        began = time.thread_time_ns()
        replay.estimator.update(k * replay.period, tuple(read), replay.command)
        taken.append(1e-3 * (time.thread_time_ns() - began))
    return float(np.median(taken[len(taken) // 4 :]))


# ---- sweeps


@dataclass(frozen=True, eq=False)
class _StoredSweep:
    """A sweep whose trials are all in its store."""

    trials: list[Trial]
    store: Path


def _stored(count: int, seed: int) -> _StoredSweep:
    missions = [_mission(count * seed + k) for k in range(count)]
    path = _folder() / f"{count}-{seed}.db"
    figures = {f"figure_{k}": 1.0 / (k + 1.0) for k in range(FIGURES)}
    if not path.exists():
        with Store.open(path) as store:
            store.add(
                *(
                    mission.record(content, "ok", success=True, summary=figures)
                    for mission, content in zip(missions, contents(missions), strict=True)
                )
            )
    return _StoredSweep(missions, path)


def _resuming(sweep: _StoredSweep) -> float:
    """[s] in which the sweep finds that nothing is left to fly, and has its records."""
    began = time.process_time()
    with Store.open(sweep.store) as store:
        run_trials(sweep.trials, store)
    return time.process_time() - began


SIDES = (129, 257, 513, 1025, 2049)
CURVES: dict[str, ScalingCurve] = {
    "replan": ScalingCurve(
        "nodes of a plan", "ms a replan", (7, 13, 25, 49, 97), 13, 1e3 * 5.0 / 3.0, "a period", _planned, _replan
    ),
    "map, built": ScalingCurve(
        "nodes of a map's side", "s to build", SIDES, 257, 60.0, "a minute", _over_map, _building
    ),
    "map, flown": ScalingCurve(
        "nodes of a map's side", "CPU s a second", SIDES, 257, 1.0, "real time", _loop_over_map, _flying, True
    ),
    "radars": ScalingCurve("radars", "s to build", (1, 4, 16, 64), 4, 60.0, "a minute", _under_radars, _building),
    "fleet": ScalingCurve(
        "vehicles",
        "CPU s a second",
        (4, 8, 16, 32, 64, 128, 256),
        16,
        1.0,
        "real time on a core",
        _fleet,
        _flying,
        True,
    ),
    "bank": ScalingCurve("hypotheses", "µs an update", (16, 64, 256, 1024), 16, 1e4, "100 Hz", _bank, _updating, True),
    "observer": ScalingCurve("joints", "µs an update", (2, 4, 8, 16, 32), 8, 1e3, "1 kHz", _observer, _updating, True),
    "trials": ScalingCurve(
        "stored trials", "s to go on", (250, 1000, 4000, 16_000), 1000, 60.0, "a minute", _stored, _resuming
    ),
}
"""by name"""

_MOST = 1e9  # times a size
LEAST_FIT = 3  # the largest sizes that an exponent is fitted to


def exponent(sizes: Sequence[int], costs: Sequence[float]) -> float:
    """p of cost ~ size^p, by least squares of logarithms over the largest sizes."""
    x, y = np.log(sizes[-LEAST_FIT:]), np.log(costs[-LEAST_FIT:])
    return float(np.polyfit(x, y, 1)[0])


def serves_up_to(curve: ScalingCurve, sizes: Sequence[int], costs: Sequence[float]) -> float:
    """Times today's size at which the limit is met, by the fit through the largest size.

    Infinite where that is more than a billion times.
    """
    if costs[-1] >= curve.limit:
        within = [size for size, cost in zip(sizes, costs, strict=True) if cost < curve.limit]
        return max(within, default=0) / curve.today
    p = exponent(sizes, costs)
    further = math.log(curve.limit / costs[-1]) / p if p > 0.0 else math.inf
    return sizes[-1] * math.exp(further) / curve.today if further < math.log(_MOST) else math.inf
