"""A finished run as pictures need it: what was flown, over which ground, behind which plans.

Everything comes from the run's folder (config.json, summary.json, events.jsonl, log.npz) and from the terrain that
config.json names; whether that is still the terrain that was flown over is checked by its digest.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from models.terrain.height_field import HeightField
from models.terrain.library import load_terrain
from sim.signals import Array, Event, Plan

MISSION_NUMBERS = ("clearance_min", "speed_max", "acceleration_max", "deadline_factor", "arrival_radius")


@dataclass(frozen=True)
class RadarSite:
    """A radar as it is drawn: where it stands, how far it sees, when it was switched on."""

    x: float  # [m] map frame
    y: float  # [m] map frame
    radius: float  # [m]
    weight: float
    time: float  # [s] 0 if it was known from the start


@dataclass(frozen=True, eq=False)
class Mission:
    """What was asked of the vehicle."""

    start: Array  # (3,) [m] map frame
    target: Array  # (3,) [m] map frame
    clearance_min: float  # [m]
    speed_max: float  # [m/s]
    acceleration_max: float  # [m/s^2]
    deadline_factor: float
    arrival_radius: float  # [m]
    radars: tuple[RadarSite, ...]


@dataclass(frozen=True, eq=False)
class RunData:
    """The run of a single vehicle."""

    directory: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    events: tuple[Event, ...]  # in order of time
    mission: Mission
    terrain: HeightField
    t: Array  # (n,) [s]
    x: Array  # (n, 6) true position [m] and velocity [m/s], map frame
    u: Array  # (n, 3) [m/s^2] commanded acceleration, held over [t_i, t_i+1)
    plans: tuple[Plan, ...]  # in order of adoption
    adopted: Array  # (len(plans),) [s]

    @property
    def duration(self) -> float:
        """[s] of flight."""
        return float(self.t[-1])

    @property
    def title(self) -> str:
        return f"{self.config['scenario']} over {self.terrain.name}, seed {self.config['seed']}"

    @cached_property
    def above_ground(self) -> Array:
        """(n,) [m] height above the ground; NaN off the map."""
        above: Array = self.x[:, 2] - self.terrain.height(self.x[:, 0], self.x[:, 1])
        return above

    @cached_property
    def travelled(self) -> Array:
        """(n,) [m] length of the path flown."""
        travelled: Array = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.x[:, :3], axis=0), axis=1))])
        return travelled

    def index(self, t: float) -> int:
        """The last tick at or before ``t`` [s]."""
        return int(np.clip(np.searchsorted(self.t, t + 1e-9, side="right") - 1, 0, len(self.t) - 1))

    def state(self, t: float) -> Array:
        """(6,) true state at ``t`` [s], linear between ticks; the first and last state beyond them."""
        i = min(self.index(t), len(self.t) - 2)
        share = float(np.clip((t - self.t[i]) / (self.t[i + 1] - self.t[i]), 0.0, 1.0))
        between: Array = (1.0 - share) * self.x[i] + share * self.x[i + 1]
        return between

    def plan(self, t: float) -> Plan | None:
        """The plan being flown at ``t`` [s]; None before the first."""
        i = int(np.searchsorted(self.adopted, t + 1e-9, side="right")) - 1
        return self.plans[i] if i >= 0 else None


def plan_arcs(plan: Plan, t: float, step: float) -> list[tuple[int, Array]]:
    """What is left of a plan at ``t`` [s]: (phase, points (m, 3) [m]) of each arc, a point about every ``step`` [s]."""
    arcs = []
    for k, phase in enumerate(plan.phase):
        begin, end = max(t, float(plan.t[k])), float(plan.t[k + 1])
        if end <= begin:
            continue
        s = np.linspace(begin, end, max(2, int(np.ceil((end - begin) / step)) + 1))[:, None] - plan.t[k]
        arcs.append((int(phase), plan.x[k, :3] + plan.x[k, 3:] * s + 0.5 * plan.u[k] * s**2))
    return arcs


def described(event: Event) -> tuple[str, str]:
    """What happened, in words, and the details."""
    if event.kind == "message" and event.message.startswith("radar "):
        return "radar on", ""
    return event.kind.replace("-", " "), event.message


def load_run(directory: str | Path) -> RunData:
    """Read a run's folder; FileNotFoundError where something is missing, ValueError where something is broken."""
    folder = Path(directory)
    if not folder.is_dir():
        raise FileNotFoundError(f"run folder {str(folder)!r} does not exist")
    config, summary = (_read_json(folder / name) for name in ("config.json", "summary.json"))
    arrays = _read_arrays(folder / "log.npz")
    try:
        place = config["terrain"]
        terrain = load_terrain(place.get("path") or place["name"])
        mission = _mission(config["mission"])
        _ = config["scenario"], config["seed"]
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{str(folder / 'config.json')!r} does not describe a run: {error!r}") from None
    if place.get("digest", terrain.digest) != terrain.digest:
        raise ValueError(
            f"terrain {place['name']!r} is no longer the one that run {str(folder)!r} flew over: its digest is "
            f"{terrain.digest[:12]}..., the run's {str(place['digest'])[:12]}..."
        )
    return RunData(folder, config, summary, _read_events(folder / "events.jsonl"), mission, terrain, **arrays)


def _mission(fields: Mapping[str, Any]) -> Mission:
    radars = tuple(
        RadarSite(*(float(radar[name]) for name in ("x", "y", "radius", "weight", "time")))
        for radar in fields.get("radars", ())
    )
    start, target = (np.array(fields[name], dtype=float) for name in ("start", "target"))
    return Mission(start, target, **{name: float(fields[name]) for name in MISSION_NUMBERS}, radars=radars)


def _require(path: Path) -> None:
    if not path.is_file():
        raise FileNotFoundError(f"run folder {str(path.parent)!r} holds no {path.name}: did the run end?")


def _read_json(path: Path) -> dict[str, Any]:
    _require(path)
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{str(path)!r} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise ValueError(f"{str(path)!r} holds a {type(value).__name__}, not an object of names and values")
    return value


def _read_events(path: Path) -> tuple[Event, ...]:
    _require(path)
    events = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            entry = json.loads(line)
            events.append(Event(float(entry["t"]), str(entry["agent"]), str(entry["kind"]), str(entry["message"])))
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{str(path)!r} line {number} is not an event: {error!r}") from None
    return tuple(sorted(events, key=lambda event: event.t))


def _read_arrays(path: Path) -> dict[str, Any]:
    _require(path)
    try:
        with np.load(path, allow_pickle=False) as log:
            arrays = dict(log)
    except Exception as error:  # a damaged archive raises BadZipFile, EOFError, OSError, zlib.error or ValueError
        raise ValueError(f"{str(path)!r} cannot be read as an array archive: {error}") from None
    names = ("t", "truth.x", "command.u")
    if missing := [name for name in names if name not in arrays]:
        raise ValueError(f"{str(path)!r} lacks {', '.join(missing)}: only the run of a single vehicle can be drawn")
    t, x, u = (arrays[name] for name in names)
    if not (t.ndim == 1 and len(t) >= 2 and x.shape == (len(t), 6) and u.shape == (len(t), 3)):
        raise ValueError(
            f"{str(path)!r}: t {t.shape}, truth.x {x.shape} and command.u {u.shape} are not (n,), (n, 6) and (n, 3) "
            "with n at least 2"
        )
    if not (np.isfinite(t).all() and np.isfinite(x).all()):
        raise ValueError(f"{str(path)!r}: t or truth.x is not finite")
    return {"t": t, "x": x, "u": u, "plans": _plans(arrays, path), "adopted": arrays.get("plan.adopted", np.empty(0))}


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
        raise ValueError(f"{str(path)!r}: the plans do not fit together: {error}") from None
