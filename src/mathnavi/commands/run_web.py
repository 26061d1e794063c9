"""``mathnavi run --web``: a run is shown in a browser while it is simulated, and the user changes its conditions.

A change is a change of the scenario's fields: the run is simulated again from its start with them, as fast as
possible, and shown from the moment of the change on. The run that is written in the end is like any other: its
config.json says what was flown, and `run --from` flies it again.
"""

from __future__ import annotations

import dataclasses
import math
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.commands.web_server import PageServer
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import FieldError
from mathnavi.renders.flight.run_data import terrain_of
from mathnavi.renders.web.document import document
from mathnavi.renders.web.live import LiveScene
from mathnavi.renders.web.scene import read_scene
from mathnavi.sim.engine.loop import Loop
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, RunData

STEP = 0.02  # [s] of the wall clock that the simulation waits at most at a time
PACES = (0.1, 20.0)  # times real time
RADAR_WEIGHT = 5.0
WAITING = """<!doctype html><html lang="en"><meta charset="utf-8"><link rel="icon" href="data:,">
<meta http-equiv="refresh" content="1"><title>mathnavi</title><p>The run is being prepared.</p></html>"""
DRIVE = 30.0  # [s] in which a target drives to its new place
PACE = "pace"  # the one slider that changes how the run is shown, not what happens


Simulate = Callable[[ClosedLoop, Callable[[Loop], None]], RunData]


class _ChangedError(Exception):
    """Change of a field by the user: this simulation is given up."""


@dataclass(frozen=True)
class Control:
    """Slider of the page, which sets one field or the pace."""

    name: str
    label: str
    low: float
    high: float
    step: float
    unit: str
    value: float


class FollowedRun:
    """State of a run for its page; the thread of the simulation and those of the server share it."""

    def __init__(self, spec: RunSpec) -> None:
        self._spec, self._lock = spec, threading.Lock()
        self.url = ""
        self._changes: set[str] = set()
        self._pace, self._paused, self._generation, self._state = 1.0, False, 0, "starting"
        self._live: LiveScene | None = None
        self._page, self._ended, self._now = WAITING, False, 0.0
        self._controls: dict[str, Control] = {}

    # ---- for the server

    def page(self) -> str:
        """Return the page in its present state."""
        with self._lock:
            return self._page

    def news(self, query: Mapping[str, str]) -> dict[str, Any]:
        """Return the samples since the one that the query names."""
        since = query.get("since", "0")
        with self._lock:
            live, generation = self._live, self._generation
            found = {"generation": generation, "ended": self._ended, "state": self._state}
        if live is None or self._ended or not since.isdecimal():
            return {**found, "t": [], "next": 0}
        return live.news(int(since)) | found

    def change(self, posted: Any) -> dict[str, str]:
        """Set sliders to values; FieldError for an unknown slider, or a value that is no number or out of bounds."""
        if not isinstance(posted, dict):
            raise FieldError("allowed: an object of names and values")
        for name, value in posted.items():
            if name == "paused" and isinstance(value, bool):
                self._paused = value
                continue
            control = self._controls.get(name)
            if control is None or isinstance(value, bool) or not isinstance(value, int | float):
                raise FieldError(f"{name} = {value!r}; allowed: numbers for {', '.join(self._controls)}")
            check(float(value), name, control.low, control.high)
            with self._lock:
                self._controls[name] = dataclasses.replace(control, value=float(value))
                if name == PACE:
                    self._pace = float(value)
                else:
                    self._changes.add(name)
        return {}

    # ---- for the simulation

    def fly(self, closed_loop: ClosedLoop, simulate: Simulate) -> RunData:
        """Simulate at the user's pace, again after every change."""
        shown_from = 0.0
        self._controls = {control.name: control for control in _controls(self._spec.config, closed_loop)}
        while True:
            self._show(closed_loop)
            try:
                return simulate(closed_loop, self._watching(shown_from))
            except _ChangedError:
                closed_loop, shown_from = self._rebuilt(closed_loop)

    def show_ended(self, folder: Path) -> None:
        """Show the run that was written, until Ctrl-C."""
        page = str(document(read_scene(folder)))
        with self._lock:
            self._page, self._ended = page, True
        print(f"{folder} is shown at {self.url} until Ctrl-C", flush=True)
        with suppress(KeyboardInterrupt):
            threading.Event().wait()

    def _show(self, closed_loop: ClosedLoop) -> None:
        title = f"{self._spec.scenario}, seed {self._spec.seed}"
        live = LiveScene(title, closed_loop.plant, closed_loop.config, closed_loop.duration, closed_loop.estimands)
        with self._lock:
            self._generation += 1
            about = {
                "generation": self._generation,
                "controls": [dataclasses.asdict(control) for control in self._controls.values()],
            }
        page = str(document(live.scene(), about))
        with self._lock:
            self._live, self._page = live, page

    def _watching(self, shown_from: float) -> Callable[[Loop], None]:
        """Return observer of every step of the loop, which takes samples, keeps the pace, and stops after a change."""
        behind, before = time.perf_counter(), shown_from  # when the present of the simulation should be reached

        def watch(loop: Loop) -> None:
            nonlocal behind, before
            live = self._live
            assert live is not None
            live.observe(loop)
            self._now = loop.t
            self._state = f"{loop.t:.1f} s" + (", up to the change" if loop.t < shown_from else "")
            if loop.t < shown_from:
                behind = time.perf_counter()
                return
            behind = max(behind + (loop.t - before) / self._pace, time.perf_counter() - STEP)
            before = loop.t
            while (time.perf_counter() < behind or self._paused) and not self._changes:
                time.sleep(min(STEP, max(behind - time.perf_counter(), 1e-3)))
            if self._changes:
                raise _ChangedError

        return watch

    def _rebuilt(self, before: ClosedLoop) -> tuple[ClosedLoop, float]:
        """Build the loop with the present fields, or again with the previous ones if those cannot be flown."""
        with self._lock:
            names, self._changes = self._changes, set()
            values = {control.name: control.value for control in self._controls.values()}
        spec, now = self._spec, round(self._now, 2)
        try:
            config = changed_config(spec.config, before.config["mission"], values, names, now)
            changed = dataclasses.replace(spec, config=config)
            built = changed.build()
        except ValueError as error:
            self._state = f"refused: {error}"
            return spec.build(), now
        self._spec = changed
        return built, now


@contextmanager
def followed(spec: RunSpec, host: str, port: int) -> Iterator[FollowedRun]:
    """Serve a run at an address for as long as the block lasts."""
    run = FollowedRun(spec)
    server = PageServer(host, port, run.page, {"/news": run.news}, {"/change": run.change})
    run.url = server.url
    with server.serving():
        print(f"{spec.scenario} is shown at {server.url} while it is simulated", flush=True)
        yield run


def _controls(config: Any, closed_loop: ClosedLoop) -> list[Control]:
    """Return the sliders: the pace, and the fields of the scenario that may change during the run."""
    found = [Control(PACE, PACE, *PACES, 0.1, "×", 1.0)]
    record = closed_loop.config
    fields = {entry.name for entry in dataclasses.fields(config)}
    if "radar" in fields and record.get("terrain"):
        ground = terrain_of(record["terrain"])
        ends = [record["mission"][name] for name in ("start", "target") if name in record["mission"]]
        middle = np.mean(ends, axis=0).tolist() if ends else [0.5 * ground.width, 0.5 * ground.depth]
        x, y, radius, _ = config.radar[0] if config.radar else (*middle[:2], 0.0, RADAR_WEIGHT)
        east, north = round(ground.width / 1e3, 2), round(ground.depth / 1e3, 2)
        step = 10.0 ** math.floor(math.log10(0.01 * east))
        found += [
            Control("radar_east", "radar, east", 0.0, east, step, "km", round(x / 1e3, 3)),
            Control("radar_north", "radar, north", 0.0, north, step, "km", round(y / 1e3, 3)),
            Control("radar_radius", "radar, radius", 0.0, round(0.2 * east, 2), step, "km", round(radius / 1e3, 3)),
        ]
        if "target_path" in fields:
            x, y, _ = record["mission"]["target"]
            found += [
                Control("target_east", "target, east", 0.0, east, step, "km", round(x / 1e3, 3)),
                Control("target_north", "target, north", 0.0, north, step, "km", round(y / 1e3, 3)),
            ]
    if hasattr(getattr(config, "faults", None), "gust_rms"):
        found.append(Control("gust_rms", "gusts, rms", 0.0, 3.0, 0.1, "m/s²", config.faults.gust_rms))
    return found


def changed_config(
    config: Any, mission: Mapping[str, Any], values: Mapping[str, float], names: Collection[str], now: float
) -> Any:
    """Return the configuration after sliders were moved at ``now`` [s]; start and target stay those of the mission.

    A radar is switched on then, and a target drives at constant speed to its new place; gusts blow from the start.
    """
    fields = {entry.name for entry in dataclasses.fields(config)}
    new: dict[str, Any] = {
        name: tuple(mission[name]) for name in ("start", "target") if {name} <= fields & set(mission)
    }
    if any(name.startswith("radar_") for name in names):
        x, y, radius = (1e3 * values[f"radar_{part}"] for part in ("east", "north", "radius"))
        weight = config.radar[0][3] if config.radar else RADAR_WEIGHT
        new |= {"radar": ((x, y, radius, weight),) if radius > 0.0 else (), "radar_time": now if radius > 0.0 else 0.0}
    if any(name.startswith("target_") for name in names):
        first = (0.0, *mission["target"])
        kept = [first, *(point for point in config.target_path if point[0] < now)]
        path = np.array([first, *config.target_path])
        here = tuple(float(np.interp(now, path[:, 0], path[:, axis])) for axis in (1, 2, 3))
        there = (1e3 * values["target_east"], 1e3 * values["target_north"], here[2])
        new["target_path"] = (*kept[1:], (now, *here), (now + DRIVE, *there))
    if "gust_rms" in names:
        new["faults"] = dataclasses.replace(config.faults, gust_rms=values["gust_rms"])
    return dataclasses.replace(config, **new)
