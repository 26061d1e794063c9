"""The folder of a run: what is written at the end of a run, and how it is read again.

| file | what it holds |
|---|---|
| ``config.json`` | scenario, seed, every field, both plug-ins, the mission that was drawn, versions |
| ``summary.json`` | figures of merit by name, with units; it is written last |
| ``events.jsonl`` | one event a line, in the order in which they were recorded |
| ``log.npz`` | the arrays of ``mathnavi.sim.engine.log`` |
| ``log.json`` | shape and type of each array; names and units of each vehicle's states |

Everything that needs a recorded run reads it here: ``read_log`` for a single vehicle, ``read_fleet`` for several.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.sim.engine.log import Recording
from mathnavi.sim.interfaces.errors import RunFolderError
from mathnavi.sim.interfaces.signals import Array, Event, Plan, Status
from mathnavi.sim.records.files import jsonable, write_json, write_text
from mathnavi.sim.records.former_names import with_present_names

CONFIG, SUMMARY, EVENTS, ARRAYS, ARRAY_INDEX = "config.json", "summary.json", "events.jsonl", "log.npz", "log.json"
TRUTH = ".truth.x"  # ending of the names of a fleet's arrays of true states


class NothingToDrawError(ValueError):
    """A run that ended before there was anything to be seen."""


# ---- writing


def versions() -> dict[str, str]:
    """Version by name of the packages that a run depends on, and of Python."""
    packages = ("mathnavi", "mujoco", "numpy", "casadi")
    return {name: version(name) for name in packages} | {"python": platform.python_version()}


def write_run(folder: Path, config: Mapping[str, Any], summary: Mapping[str, Any], recording: Recording) -> None:
    """Write a run's folder, summary.json last, so that a summary means a whole run."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / SUMMARY).unlink(missing_ok=True)
    arrays = recording.arrays()
    partial = folder / f".{ARRAYS}.partial"
    partial.unlink(missing_ok=True)  # a link there is not followed
    try:
        with partial.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        os.replace(partial, folder / ARRAYS)
    finally:
        partial.unlink(missing_ok=True)
    shapes = {name: {"shape": list(value.shape), "dtype": str(value.dtype)} for name, value in arrays.items()}
    write_json(folder / ARRAY_INDEX, {"arrays": shapes, "states": recording.state_names, "time": "t [s]"})
    events = [{"t": e.t, "agent": e.agent, "kind": e.kind, "message": e.message} for e in recording.events]
    write_text(folder / EVENTS, "".join(json.dumps(jsonable(event)) + "\n" for event in events))
    write_json(folder / CONFIG, {**config, "versions": versions()})
    write_json(folder / SUMMARY, {**summary, "version": version("mathnavi")})


# ---- reading


@dataclass(frozen=True, eq=False)
class RunLog:
    """The run of a single vehicle."""

    directory: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    events: tuple[Event, ...]  # in order of time
    t: Array  # (n,) [s]
    x: Array  # (n, nx) the true state
    u: Array  # (n, nu) the commanded input, held over [t_i, t_i+1)
    plans: tuple[Plan, ...]  # in order of adoption
    adopted: Array  # (len(plans),) [s]
    arrays: Mapping[str, Array]  # every array of the vehicle as it was recorded, without the prefix of a fleet

    @property
    def title(self) -> str:
        """Scenario and seed."""
        return f"{self.config['scenario']}, seed {self.config['seed']}"

    @cached_property
    def _statuses(self) -> tuple[Array, tuple[Status, ...]]:
        """Times [s] at which the estimator's status changed, and the status from each of them on."""
        changes = [event for event in self.events if event.kind == "estimator-status"]
        named = tuple(Status[event.message.partition(":")[0].upper()] for event in changes)
        return np.array([event.t for event in changes]), named

    def status(self, t: float) -> Status:
        """Status of the newest estimate at ``t`` [s]."""
        times, named = self._statuses
        k = last_at(times, t)
        return named[k] if k >= 0 else Status.OK


@dataclass(frozen=True, eq=False)
class FleetLog:
    """The run of a fleet."""

    directory: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    events: tuple[Event, ...]  # of all vehicles, in order of time
    vehicles: Mapping[str, RunLog]  # by name, each with its own events


def last_at(times: Array, t: float) -> int:
    """Index of the last of the times (n,) at or before ``t``; -1 before the first."""
    return int(np.searchsorted(times, t + 1e-9, side="right")) - 1


def described(event: Event) -> tuple[str, str]:
    """Kind of an event in plain words, and its details."""
    if event.kind == "message" and event.message.startswith("radar "):
        return "radar on", ""
    return event.kind.replace("-", " "), event.message


def read_log(directory: str | Path, *, may_diverge: bool = False) -> RunLog:
    """Read the folder of a single vehicle's run.

    With ``may_diverge`` a run ends with its last finite state; without it, all states have to be finite. Raises
    FileNotFoundError where something is missing, RunFolderError where something is broken.
    """
    folder = existing_folder(directory)
    config, summary, events = _read_texts(folder)
    path = folder / ARRAYS
    return RunLog(folder, config, summary, events, **_of_vehicle(_read_arrays(path), path, may_diverge))


def read_fleet(directory: str | Path) -> FleetLog:
    """Read the folder of a fleet's run; errors as of ``read_log``. The log of a single vehicle is refused."""
    folder = existing_folder(directory)
    config, summary, events = _read_texts(folder)
    path = folder / ARRAYS
    arrays = _read_arrays(path)
    names = [key.removesuffix(TRUTH) for key in arrays if key.endswith(TRUTH)]
    if not names:
        raise RunFolderError(f"{str(path)!r} lacks VEHICLE{TRUTH}: only the run of a fleet can be drawn so")
    vehicles = {
        name: RunLog(
            folder, config, summary, tuple(event for event in events if event.agent == name),
            **_of_vehicle(_without_prefix(arrays, f"{name}."), path, may_diverge=False, prefix=f"{name}."),
        )
        for name in names
    }  # fmt: skip
    return FleetLog(folder, config, summary, events, vehicles)


def read_state_names(directory: str | Path) -> dict[str, tuple[str, ...]]:
    """Names of the states with their units, (nx,) by vehicle; errors as of ``read_log``."""
    states = read_json(Path(directory) / ARRAY_INDEX).get("states", {})
    return {vehicle: tuple(names) for vehicle, names in states.items()}


def existing_folder(directory: str | Path) -> Path:
    """Path of a run's folder; FileNotFoundError where there is none."""
    folder = Path(directory)
    if not folder.is_dir():
        raise FileNotFoundError(f"run folder {str(folder)!r} does not exist")
    return folder


def read_json(path: Path) -> dict[str, Any]:
    """Read the object in a file of a run's folder; errors as of ``read_log``."""
    _require(path)
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise RunFolderError(f"{str(path)!r} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise RunFolderError(f"{str(path)!r} holds a {type(value).__name__}, not an object of names and values")
    return value


def _without_prefix(arrays: Mapping[str, Array], prefix: str) -> dict[str, Array]:
    """The arrays whose names begin with ``prefix``, under the rest of their names, and the times."""
    own = {key.removeprefix(prefix): rows for key, rows in arrays.items() if key.startswith(prefix)}
    return own | ({"t": arrays["t"]} if "t" in arrays else {})


def _read_texts(folder: Path) -> tuple[dict[str, Any], dict[str, Any], tuple[Event, ...]]:
    """Configuration, summary and events."""
    config, summary = (read_json(folder / name) for name in (CONFIG, SUMMARY))
    if missing := [name for name in ("scenario", "seed") if name not in config]:
        raise RunFolderError(f"{str(folder / CONFIG)!r} does not describe a run: it lacks {' and '.join(missing)}")
    return with_present_names(config), summary, _read_events(folder / EVENTS)


def _require(path: Path) -> None:
    if not path.is_file():
        raise FileNotFoundError(f"run folder {str(path.parent)!r} holds no {path.name}: did the run end?")


def _read_events(path: Path) -> tuple[Event, ...]:
    _require(path)
    events = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            entry = json.loads(line)
            events.append(Event(float(entry["t"]), str(entry["agent"]), str(entry["kind"]), str(entry["message"])))
        except (ValueError, KeyError, TypeError) as error:
            raise RunFolderError(f"{str(path)!r} line {number} is not an event: {error!r}") from None
    return tuple(sorted(events, key=lambda event: event.t))


def _read_arrays(path: Path) -> dict[str, Array]:
    _require(path)
    try:
        with np.load(path, allow_pickle=False) as log:
            return dict(log)
    except Exception as error:  # a damaged archive raises BadZipFile, EOFError, OSError, zlib.error or ValueError
        raise RunFolderError(f"{str(path)!r} cannot be read as an array archive: {error}") from None


def _of_vehicle(arrays: Mapping[str, Array], path: Path, may_diverge: bool, prefix: str = "") -> dict[str, Any]:
    """Fields of a ``RunLog`` from the arrays of one vehicle; ``prefix`` is what their names have in the file."""
    names = ("t", "truth.x", "command.u")
    if missing := [name if name == "t" else f"{prefix}{name}" for name in names if name not in arrays]:
        if not prefix and any(name.endswith(TRUTH) for name in arrays):
            raise RunFolderError(f"{str(path)!r} is the log of a fleet; allowed: the run of a single vehicle")
        raise RunFolderError(f"{str(path)!r} lacks {', '.join(missing)}")
    t, x, u = (arrays[name] for name in names)
    if not (t.ndim == 1 and len(t) >= 2 and all(rows.ndim == 2 and len(rows) == len(t) for rows in (x, u))):
        raise RunFolderError(
            f"{str(path)!r}: t {t.shape}, {prefix}truth.x {x.shape} and {prefix}command.u {u.shape} are not (n,), "
            "(n, nx) and (n, nu) with n at least 2"
        )
    finite = int(np.logical_and.accumulate(np.isfinite(x).all(axis=1)).sum())
    if may_diverge:
        if finite < 2:
            raise NothingToDrawError(f"{str(path)!r}: truth.x is not finite from the second sample on")
        t, x, u = t[:finite], x[:finite], u[:finite]
    if not (np.isfinite(t).all() and np.isfinite(x).all()):
        raise RunFolderError(f"{str(path)!r}: t or {prefix}truth.x is not finite")
    adopted = arrays.get("plan.adopted", np.empty(0))
    return {"t": t, "x": x, "u": u, "plans": _plans(arrays, path), "adopted": adopted, "arrays": arrays}


def _plans(arrays: Mapping[str, Array], path: Path) -> tuple[Plan, ...]:
    if "plan.offsets" not in arrays:
        return ()
    try:
        t, x, u, phase = (arrays[f"plan.{name}"] for name in ("t", "x", "u", "phase"))
        offsets: Sequence[int] = arrays["plan.offsets"].astype(int).tolist()
        return tuple(
            Plan(t[a:b], x[a:b], u[a : b - 1], phase[a : b - 1].astype(np.int64), cost=float(cost))
            for a, b, cost in zip(offsets[:-1], offsets[1:], arrays["plan.cost"], strict=True)
        )
    except (KeyError, ValueError) as error:
        raise RunFolderError(f"{str(path)!r}: the plans do not fit together: {error}") from None


def read_arrays(directory: str | Path) -> dict[str, Array]:
    """Every array of a run's log by its dotted name; errors as of ``read_log``."""
    return _read_arrays(existing_folder(directory) / ARRAYS)


def read_record(directory: str | Path) -> tuple[dict[str, Any], dict[str, Any], tuple[Event, ...]]:
    """Configuration, summary and events of a run; errors as of ``read_log``."""
    return _read_texts(existing_folder(directory))
