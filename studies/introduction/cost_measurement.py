"""Measurements of ``scaling``: CPU time and memory of one process for each size of every curve, and rates of sweeps.

Each size is a separate job. It does its work once at the smallest size, so that kernels are loaded, and then at the
requested size. No map is read twice: each is written to a new file.

Sweeps consist of empty trials: their rate with local processes, with a Dask cluster, and into the store. The cluster's
workers are processes of this machine that reach their scheduler through a relay which delays every byte like a network.
"""

from __future__ import annotations

import asyncio
import atexit
import importlib
import importlib.util
import itertools
import math
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from scipy.ndimage import zoom

from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.store import Store
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.sweep.execution import Progress, run_jobs, run_trials
from mathnavi.sim.sweep.job import Job, job
from mathnavi.sim.sweep.trial import Trial, contents, trial
from mathnavi.studies.ranging.estimator_runs import START, declared_mission, noisy_run
from mathnavi.studies.ranging.observability_measures import STANDARD

GROUND = "tian_shan"
FLOWN = 20.0  # [s] of a fleet's flight
SLOT_SPACING = 600.0  # [m] with which the slots of the largest fleet lie on the map
UPDATES = 200  # of an estimator
FIGURES = 40  # of a trial's summary
PATIENCE = 60.0  # [s] until the workers of a cluster are there
_CHUNK = 1 << 16  # bytes that the relay reads at once
_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_RESET_PEAK = "5"  # proc(5): the peak becomes what is resident now


@dataclass(frozen=True)
class Measured:
    """Measured cost of one size."""

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

    ``cost(made(size, seed))`` is the cost; the time of ``made`` is excluded. A size is usable while its cost is below
    ``limit``; ``today`` is the usual size.
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


class PeakMemory:
    """Context that measures the memory of this process: ``grown`` [MB] is the rise of its peak above the start.

    It is NaN where the system does not report memory, as outside Linux.
    """

    def __init__(self) -> None:
        self.grown = math.nan
        self._before = math.nan

    def __enter__(self) -> PeakMemory:
        try:
            _RESET.write_text(_RESET_PEAK)
            self._before = _megabytes("VmRSS")
        except OSError:
            self._before = math.nan
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if not math.isnan(self._before):
            self.grown = _megabytes("VmHWM") - self._before


def _megabytes(name: str) -> float:
    rows = (row.split() for row in _STATUS.read_text().splitlines())
    return next(float(row[1]) for row in rows if row[:1] == [f"{name}:"]) / 1024.0


# ---- flight


def _mission(seed: int, **fields: Any) -> Trial:
    return trial("safe-flight", seed, fields={"terrain": GROUND, "drawn_separation": (0.15, 0.2), **fields})


def _planned(nodes: int, seed: int) -> Trial:
    period = 5.0 / 3.0
    return _mission(seed, **{"planner.nodes": nodes, "planner.horizon": 20.0, "planner.period": period})


def _replan(flight: Trial) -> float:
    return float(flight.flown().summary["solve_ms_mean"])


_moments = itertools.count(1)  # [s] at which files were changed last


@cache
def _folder() -> Path:
    """Return a folder of this process, which is removed at its exit."""
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    return Path(folder.name)


def _over_map(side: int, seed: int) -> Trial:
    """Return a mission over the same ground with ``side`` x ``side`` nodes, in a file that no mission has read."""
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
    """An estimator and the arguments of its updates."""

    estimator: Estimator
    readings: Sequence[Sequence[Measurement]]
    command: Array
    period: float  # [s]


def _bank(count: int, seed: int) -> _Replay:
    """Return the bank with ``count`` hypotheses, none of which is dropped."""
    mission = declared_mission(STANDARD, "2s")
    readings = noisy_run(mission, np.array(START), UPDATES * mission.period, np.random.default_rng(seed)).readings
    plugin = load("estimators", "feasible_set_bank")
    config = plugin.Config(hypotheses=count, candidates=max(300, 4 * count), lowest=-1e300)
    return _Replay(plugin.build(config, mission), readings, np.zeros(2), mission.period)


def _observer(joints: int, seed: int) -> _Replay:
    """Return the intrinsic observer of a chain of hinges."""
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
    """Return the MJCF of a chain of links of decreasing mass, with hinges about two alternating axes."""
    opened = "".join(
        f'<body pos="0 0 {0.0 if k == 0 else -0.2}"><joint name="j{k}" type="hinge" axis="{k % 2} {1 - k % 2} 0"/>'
        f'<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="{0.9**k:.6g}" contype="0" conaffinity="0"/>'
        for k in range(joints)
    )
    motors = "".join(f'<motor name="m{k}" joint="j{k}"/>' for k in range(joints))
    return f"<mujoco><worldbody>{opened}{'</body>' * joints}</worldbody><actuator>{motors}</actuator></mujoco>"


def _updating(replay: _Replay) -> float:
    """Return the median CPU time [us] of the updates after the first quarter."""
    taken = []
    for k, read in enumerate(replay.readings):
        began = time.thread_time_ns()
        replay.estimator.update(k * replay.period, tuple(read), replay.command)
        taken.append(1e-3 * (time.thread_time_ns() - began))
    return float(np.median(taken[len(taken) // 4 :]))


# ---- stored trials


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
    """Return the CPU time [s] in which the sweep finds all its trials in the store, and reads their records."""
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
"""curves by name"""


# ---- sweeps of trials that do nothing


@dataclass(frozen=True)
class SweepCase:
    """A sweep of empty trials, with local processes or on a cluster."""

    workers: int
    trials: int
    delay: float | None = None  # [s] one way, between a cluster's scheduler and its workers; None: no cluster


def nothing(number: int) -> int:
    """A job: an empty trial."""
    return number


def trials(count: int) -> list[Job]:
    """Return ``count`` empty trials."""
    return [job(nothing, number) for number in range(count)]


def swept(cases: Sequence[SweepCase]) -> list[dict[str, Any]]:
    """A job: rows of the sweeps, run one after the other; those on a cluster only if Dask is installed.

    ``start_wall_s`` is the time until as many trials had ended as there are workers, ``cost_wall_s`` the mean time
    between the ends of two trials after that.
    """
    return [_swept(case) for case in cases if case.delay is None or importlib.util.find_spec("distributed")]


def written(count: int) -> MeasuredTime:
    """A job: mean time [s] in which the store commits one record."""
    made = [each.record(each.content, "ok", result=str(number)) for number, each in enumerate(trials(count))]
    with tempfile.TemporaryDirectory() as folder, Store.open(Path(folder) / "trials.db") as store:
        began = time.perf_counter()
        for record in made:
            store.add(record)
        return MeasuredTime((time.perf_counter() - began) / count)


def _swept(case: SweepCase) -> dict[str, Any]:
    ends: list[float] = []

    def note(state: Progress) -> None:
        ends.extend([time.perf_counter() - began] * (state.done - len(ends)))

    with ExitStack() as opened:
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
        store = opened.enter_context(Store.open(folder / "trials.db"))
        address = None if case.delay is None else opened.enter_context(_cluster(case.workers, case.delay))
        began = time.perf_counter()
        run_jobs(trials(case.trials), store, workers=case.workers, cluster=address, progress=note)
    start = ends[case.workers - 1]
    interval = (ends[-1] - start) / (len(ends) - case.workers)
    return {
        "curve": "sweep", "size": case.workers, "unit": "s a trial", "delay_s": case.delay,
        "cost_wall_s": MeasuredTime(interval), "start_wall_s": MeasuredTime(start),
    }  # fmt: skip


@contextmanager
def _cluster(workers: int, delay: float) -> Iterator[str]:
    """Start a Dask scheduler and workers with ``delay`` [s] between them on this machine, and yield its address."""
    dask: Any = importlib.import_module("distributed")  # an extra, without types
    with dask.LocalCluster(n_workers=0, dashboard_address=None) as cluster, ExitStack() as opened:
        scheduler = str(cluster.scheduler_address)
        host, _, port = scheduler.rpartition("/")[2].rpartition(":")
        relay = opened.enter_context(delayed(host, int(port), delay))
        command = [
            sys.executable, "-m", "distributed.cli.dask_worker", f"tcp://127.0.0.1:{relay}", "--nthreads", "1",
            "--no-dashboard", "--no-nanny",
        ]  # fmt: skip
        for _ in range(workers):
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            opened.callback(process.wait)
            opened.callback(process.terminate)
        with dask.Client(scheduler, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=PATIENCE)
        yield scheduler


@contextmanager
def delayed(host: str, port: int, delay: float) -> Iterator[int]:
    """Yield a port of this machine that relays connections to ``host:port`` with ``delay`` [s] in both directions."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, onward = await asyncio.open_connection(host, port)
        await asyncio.gather(_carry(reader, onward, delay), _carry(there, writer, delay))

    async def open_server() -> asyncio.Server:
        return await asyncio.start_server(meet, "127.0.0.1", 0)

    async def close() -> None:
        server.close()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    server = asyncio.run_coroutine_threadsafe(open_server(), loop).result()
    try:
        yield int(server.sockets[0].getsockname()[1])
    finally:
        asyncio.run_coroutine_threadsafe(close(), loop).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, delay: float) -> None:
    """Write each chunk ``delay`` [s] after it was read, while later chunks are read."""
    waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()
    clock = asyncio.get_running_loop().time

    async def write() -> None:
        while True:
            due, data = await waiting.get()
            await asyncio.sleep(due - clock())
            if not data:
                return
            writer.write(data)
            await writer.drain()

    writing = asyncio.create_task(write())
    with suppress(ConnectionError):
        while data := await reader.read(_CHUNK):
            waiting.put_nowait((clock() + delay, data))
    waiting.put_nowait((clock() + delay, b""))
    with suppress(ConnectionError):
        await writing
    writer.close()
