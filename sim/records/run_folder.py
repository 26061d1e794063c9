"""Folder of a run: the files that are written at the end of a run, and how they are read again.

| file | content |
|---|---|
| ``config.json`` | scenario, seed, every field, both plug-ins, digests of files and sources, mission, environment |
| ``summary.json`` | figures of merit by name, with units |
| ``events.jsonl`` | one event on each line, in the order in which they were recorded |
| ``log.npz`` | the arrays of ``mathnavi.sim.engine.log`` |
| ``log.json`` | shape and type of each array; names and units of each vehicle's signals |
| ``scene.npz`` | shapes and poses (``mathnavi.sim.engine.scene_record``), for a run whose scenario names no drawing |
| ``timing.json`` | wall-clock times of the components' answers (``mathnavi.sim.records.timing``) |
| ``delays.json`` | simulated times that plans took, for a run in which they took any |

All code that needs a recorded run reads it here: ``read_log`` for a single vehicle, ``read_fleet`` for several.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import FieldError, RunFolderError
from mathnavi.interfaces.reading import files
from mathnavi.interfaces.reading.arrays import NUMBERS_AND_TEXTS, read_npz
from mathnavi.interfaces.schema import known_fields, shortened
from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Array, Event, Plan, Status
from mathnavi.interfaces.writing import write_bytes, write_text
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.records.claimed_folder import claimed
from mathnavi.sim.records.computing_environment import machine, versions
from mathnavi.sim.records.documents import ArrayIndexDocument, RunDocument, check_summary
from mathnavi.sim.records.files import jsonable, npz_bytes, write_json
from mathnavi.sim.records.log_arrays import COMMAND, ESTIMANDS, SAMPLED, TIME, TRUTH, check_arrays
from mathnavi.sim.records.timing import DELAYS, LATENCY, TIMING, Timing

CONFIG, SUMMARY, EVENTS, ARRAYS, ARRAY_INDEX = "config.json", "summary.json", "events.jsonl", "log.npz", "log.json"
SCENE = "scene.npz"
RUN_FILES = (CONFIG, EVENTS, ARRAYS, ARRAY_INDEX, SUMMARY)
SOMETIMES = (SCENE, TIMING, DELAYS)  # files that not every run writes
RECORDED = (*RUN_FILES, *SOMETIMES)  # all files that a run may write
STATUS_CHANGE = "estimator-status"  # kind of the events that say so
_NAMED = (
    "inputs",
    "readings",
    "estimates",
    "estimands",
    "figures",
    "groups",
)  # fields of SignalNames besides the states
FLEET_TRUTH = f".{TRUTH}"  # ending of the names of a fleet's arrays of true states


class NothingToDrawError(ValueError):
    """Run that ended before there was anything to draw."""


# ---- writing


def write_run(
    folder: Path,
    config: Mapping[str, Any],
    summary: Mapping[str, Any],
    recording: Recording,
    scene: Mapping[str, Array] | None = None,
    timing: Timing | None = None,
) -> None:
    """Write a run's folder, whole or not at all; other files in it are kept.

    ``scene`` are the arrays of ``mathnavi.sim.engine.scene_record``, for a run that is drawn from them; ``timing`` is
    how long the answers of its components took. Raises RunFolderError and OSError as ``claimed_folder.claimed`` does;
    OSError names the file.
    """
    with claimed(folder) as claim:
        write_run_files(claim.new, config, summary, recording, scene, timing)
        claim.install(dropped=RECORDED)


def write_run_files(
    folder: Path,
    config: Mapping[str, Any],
    summary: Mapping[str, Any],
    recording: Recording,
    scene: Mapping[str, Array] | None = None,
    timing: Timing | None = None,
) -> None:
    """Write the files of a run into an existing folder; OSError names the one that could not be written."""
    arrays = recording.arrays()
    write_bytes(folder / ARRAYS, npz_bytes(arrays))
    if scene is not None:
        write_bytes(folder / SCENE, npz_bytes(scene))
    if timing is not None:
        write_json(folder / TIMING, asdict(timing))
    if LATENCY in config:
        write_json(folder / DELAYS, {"delays_s": {name: agent.delays for name, agent in recording.agents.items()}})
    shapes = {name: {"shape": list(value.shape), "dtype": str(value.dtype)} for name, value in arrays.items()}
    named: dict[str, Any] = {"states": recording.state_names, "time": "t [s]"}
    if recording.activation_names:
        named["activations"] = recording.activation_names
    for part in _NAMED:
        if known := {name: own for name, each in recording.signals.items() if (own := getattr(each, part))}:
            named[part] = known
    write_json(folder / ARRAY_INDEX, {"arrays": shapes, **named})
    events = [{"t": e.t, "agent": e.agent, "kind": e.kind, "message": e.message} for e in recording.events]
    write_text(folder / EVENTS, "".join(json.dumps(jsonable(event)) + "\n" for event in events))
    made_by = {"versions": {"mathnavi": version("mathnavi"), **versions()}, "machine": machine()}
    write_json(folder / CONFIG, {**config, **made_by})
    write_json(folder / SUMMARY, {**summary, "version": version("mathnavi")})


# ---- reading


@dataclass(frozen=True, eq=False)
class RunLog:
    """Log of the run of a single vehicle."""

    directory: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    events: tuple[Event, ...]  # in order of time
    t: Array  # (n,) [s]
    x: Array  # (n, nx) the true state
    u: Array  # (n, nu) the commanded input, held over [t_i, t_i+1)
    plans: tuple[Plan, ...]  # in order of adoption
    adopted: Array  # (len(plans),) [s]
    arrays: Mapping[str, Array]  # every array of the vehicle as recorded, without the prefix of a fleet

    @property
    def title(self) -> str:
        """Scenario and seed."""
        return f"{self.config['scenario']}, seed {self.config['seed']}"

    @cached_property
    def _statuses(self) -> tuple[Array, tuple[Status, ...]]:
        """Return the times [s] at which the estimator's status changed, and the status from each of them on."""
        changes = [event for event in self.events if event.kind == STATUS_CHANGE]
        named = tuple(Status[_status_name(event)] for event in changes)
        return np.array([event.t for event in changes]), named

    def status(self, t: float) -> Status:
        """Return the status of the newest estimate at ``t`` [s]."""
        times, named = self._statuses
        k = last_at(times, t)
        return named[k] if k >= 0 else Status.OK


@dataclass(frozen=True, eq=False)
class FleetLog:
    """Log of the run of a fleet."""

    directory: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    events: tuple[Event, ...]  # of all vehicles, in order of time
    vehicles: Mapping[str, RunLog]  # by name, each with its own events


def last_at(times: Array, t: float) -> int:
    """Return the index of the last of the times (n,) at or before ``t``; -1 before the first."""
    return int(np.searchsorted(times, t + 1e-9, side="right")) - 1


def described(event: Event) -> tuple[str, str]:
    """Return the kind of an event in plain words, and its details."""
    if event.kind == "message" and event.message.startswith("radar "):
        return "radar on", ""
    return event.kind.replace("-", " "), event.message


def read_log(directory: str | Path, *, may_diverge: bool = False) -> RunLog:
    """Read the folder of a single vehicle's run.

    With ``may_diverge`` a run ends with its last finite state; without it, all states must be finite. Raises
    FileNotFoundError if a file is missing, RunFolderError if one is broken.
    """
    folder = existing_folder(directory)
    config, summary, events = _read_texts(folder)
    path = folder / ARRAYS
    log = RunLog(folder, config, summary, events, **_of_vehicle(_read_arrays(path), path, may_diverge))
    if (folder / ARRAY_INDEX).is_file() and len(signals := read_signal_names(folder)) == 1:
        _check_named(path, "", log.arrays, next(iter(signals.values())))
    return log


def read_fleet(directory: str | Path) -> FleetLog:
    """Read the folder of a fleet's run; errors as of ``read_log``. The log of a single vehicle is refused."""
    folder = existing_folder(directory)
    config, summary, events = _read_texts(folder)
    path = folder / ARRAYS
    arrays = _read_arrays(path)
    names = [key.removesuffix(FLEET_TRUTH) for key in arrays if key.endswith(FLEET_TRUTH)]
    if not names:
        raise RunFolderError(f"{str(path)!r} lacks VEHICLE{FLEET_TRUTH}: only the run of a fleet can be drawn so")
    vehicles = {
        name: RunLog(
            folder, config, summary, tuple(event for event in events if event.agent == name),
            **_of_vehicle(_without_prefix(arrays, f"{name}."), path, may_diverge=False, prefix=f"{name}."),
        )
        for name in names
    }  # fmt: skip
    signals = read_signal_names(folder) if (folder / ARRAY_INDEX).is_file() else {}
    for name in signals.keys() & vehicles.keys():
        _check_named(path, f"{name}.", vehicles[name].arrays, signals[name])
    return FleetLog(folder, config, summary, events, vehicles)


def read_state_names(directory: str | Path) -> dict[str, tuple[str, ...]]:
    """Read the names of the states with their units, (nx,) by vehicle; errors as of ``read_log``."""
    return _read_index(directory).states


def read_signal_names(directory: str | Path) -> dict[str, SignalNames]:
    """Read the names of all signals by vehicle, as far as known; errors as of ``read_log``."""
    index = _read_index(directory)
    return {
        name: SignalNames(states, **{part: own[name] for part in _NAMED if name in (own := getattr(index, part))})
        for name, states in index.states.items()
    }


def read_activation_names(directory: str | Path) -> dict[str, tuple[str, ...]]:
    """Read the names of the activations with their units, (na,) by vehicle that has any; errors as of ``read_log``."""
    return _read_index(directory).activations


def _read_index(directory: str | Path) -> ArrayIndexDocument:
    path = Path(directory) / ARRAY_INDEX
    _require(path)
    index: ArrayIndexDocument = files.read_json(path, ArrayIndexDocument, RunFolderError)
    return index


def existing_folder(directory: str | Path) -> Path:
    """Return the path of a run's folder; FileNotFoundError if it does not exist."""
    folder = Path(directory)
    if not folder.is_dir():
        raise FileNotFoundError(f"run folder {str(folder)!r} does not exist")
    return folder


def read_json(path: Path) -> dict[str, Any]:
    """Read the object in a file of a run's folder; errors as of ``read_log``."""
    _require(path)
    value: dict[str, Any] = files.read_json(path, dict[str, Any], RunFolderError)
    return value


def read_run_document(directory: Path) -> tuple[RunDocument, dict[str, Any]]:
    """Read config.json of a run, as its dataclass and as plain data; errors as of ``read_log``."""
    path = directory / CONFIG
    _require(path)
    document, plain = files.read_document(path, RunDocument, RunFolderError)
    return document, plain


def _without_prefix(arrays: Mapping[str, Array], prefix: str) -> dict[str, Array]:
    """Return the arrays whose names begin with ``prefix``, under the rest of their names, and the times."""
    own = {key.removeprefix(prefix): rows for key, rows in arrays.items() if key.startswith(prefix)}
    return own | ({"t": arrays["t"]} if "t" in arrays else {})


def _read_texts(folder: Path) -> tuple[dict[str, Any], dict[str, Any], tuple[Event, ...]]:
    """Read configuration, summary and events."""
    _, config = read_run_document(folder)
    summary = read_json(folder / SUMMARY)
    try:
        check_summary(summary)
    except FieldError as error:
        raise RunFolderError(f"{folder / SUMMARY}: {error}") from None
    known = known_fields(RunDocument)
    config = {name: value for name, value in config.items() if value is not None or name not in known}
    return config, summary, _read_events(folder / EVENTS)


def _check_named(path: Path, prefix: str, arrays: Mapping[str, Array], signals: SignalNames) -> None:
    """Raise RunFolderError for an array of which log.json names another number of columns: it is of another run."""
    named = {
        (TRUTH, "states"): signals.states,
        (COMMAND, "inputs"): signals.inputs,
        ("estimate.x", "numbers"): signals.estimates,
        (ESTIMANDS, "estimands"): signals.estimands,
        **{(f"{SAMPLED}{sensor}", "numbers"): names for sensor, names in signals.readings.items()},
    }
    for (name, what), names in named.items():
        if name in arrays and names and arrays[name].shape[1:] != (len(names),):
            raise RunFolderError(
                f"{path}: {prefix}{name} has {arrays[name].shape[-1]} {what}; allowed: {len(names)}, as {ARRAY_INDEX} "
                "next to it names"
            )
    if arrays[TRUTH].shape[1] and not signals.states:
        raise RunFolderError(f"{path}: {prefix}{TRUTH} has states; allowed: none, as {ARRAY_INDEX} next to it names")


def _require(path: Path) -> None:
    if not path.is_file():
        raise FileNotFoundError(f"run folder {str(path.parent)!r} holds no {path.name}: did the run end?")


def _read_events(path: Path) -> tuple[Event, ...]:
    _require(path)
    events: list[Event] = sorted(files.read_lines(path, Event, RunFolderError), key=lambda event: event.t)
    for event in events:
        if event.kind == STATUS_CHANGE and _status_name(event) not in Status.__members__:
            raise RunFolderError(
                f"{path}: at {event.t:g} s the estimator's status is {shortened(event.message)}; allowed: "
                f"{', '.join(name.lower() for name in Status.__members__)}"
            )
    return tuple(events)


def _status_name(event: Event) -> str:
    """Return the name of the status that an estimator took."""
    return event.message.partition(":")[0].upper()


def _read_arrays(path: Path) -> dict[str, Array]:
    _require(path)
    return read_npz(path, RunFolderError)


def _of_vehicle(arrays: Mapping[str, Array], path: Path, may_diverge: bool, prefix: str = "") -> dict[str, Any]:
    """Return fields of a ``RunLog`` from the arrays of one vehicle; ``prefix`` is that of their names in the file."""
    check_arrays(arrays, path, prefix)
    t, x, u = (arrays[name] for name in (TIME, TRUTH, COMMAND))
    finite = int(np.logical_and.accumulate(np.isfinite(x).all(axis=1)).sum())
    if may_diverge:
        if finite < 2:
            raise NothingToDrawError(f"{str(path)!r}: truth.x is not finite from the second sample on")
        t, x, u = t[:finite], x[:finite], u[:finite]
    elif finite < len(x):
        raise RunFolderError(f"{str(path)!r}: {prefix}truth.x is not finite")
    adopted = arrays.get("plan.adopted", np.empty(0))
    return {"t": t, "x": x, "u": u, "plans": _plans(arrays), "adopted": adopted, "arrays": arrays}


def _plans(arrays: Mapping[str, Array]) -> tuple[Plan, ...]:
    if "plan.offsets" not in arrays:
        return ()
    t, x, u, phase, cost = (arrays[f"plan.{name}"] for name in ("t", "x", "u", "phase", "cost"))
    offsets: Sequence[int] = arrays["plan.offsets"].tolist()
    return tuple(
        Plan(t[a:b], x[a:b], u[a : b - 1], phase[a : b - 1].astype(np.int64), cost=float(each))
        for a, b, each in zip(offsets[:-1], offsets[1:], cost, strict=True)
    )


def read_arrays(directory: str | Path) -> dict[str, Array]:
    """Read every array of a run's log by its dotted name; errors as of ``read_log``."""
    return _read_arrays(existing_folder(directory) / ARRAYS)


def read_scene(directory: str | Path) -> dict[str, Array] | None:
    """Read the arrays of a run's scene (``mathnavi.sim.engine.scene_record``); None if it has none."""
    path = existing_folder(directory) / SCENE
    return read_npz(path, RunFolderError, kinds=NUMBERS_AND_TEXTS) if path.exists() else None


def read_scene_cameras(directory: str | Path) -> tuple[str, ...] | None:
    """Read the names of the cameras of a run's scene; None if it has no scene."""
    path, name = existing_folder(directory) / SCENE, "camera.names"
    if not path.exists():
        return None
    found = read_npz(path, RunFolderError, kinds=NUMBERS_AND_TEXTS, names=(name,))
    return tuple(str(each) for each in found[name].ravel().tolist()) if name in found else ()


def read_record(directory: str | Path) -> tuple[dict[str, Any], dict[str, Any], tuple[Event, ...]]:
    """Read configuration, summary and events of a run; errors as of ``read_log``."""
    return _read_texts(existing_folder(directory))
