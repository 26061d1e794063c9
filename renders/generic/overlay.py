"""Overlay of the pictures of a scene whose scenario has no drawing."""

from __future__ import annotations

from mathnavi.renders.film import Frame
from mathnavi.renders.generic.run_data import GenericRun, index
from mathnavi.renders.generic.shot_list import short_verdict
from mathnavi.renders.overlay import Key, Overlay, pace
from mathnavi.renders.palette import SceneElement, vehicle_colour

MOST_VALUES = 2  # of the state, next to the time


def overlay(run: GenericRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    assert run.scene is not None
    parts = f"{_plain(run.config, 'controller')}, {_plain(run.config, 'estimator')}"
    name, log = next(iter(run.vehicles.items()))
    state = log.x[index(log.t, frame.t)]
    several = len(run.vehicles) > 1
    values = [] if several else [_value(label, value) for label, value in zip(run.states[name], state, strict=True)]
    flown: list[SceneElement | Key] = [SceneElement.FLOWN]
    if several:
        flown = [Key(each, vehicle_colour(k)) for k, each in enumerate(run.vehicles)]
    return Overlay(
        title=(f"mathnavi · {run.config['scenario']} · seed {run.config['seed']}", parts),
        numbers=(("TIME", f"{frame.t:.2f} s", pace(frame, run.duration)), *values[:MOST_VALUES]),
        state=short_verdict(run) if frame.t >= run.duration else run.status(frame.t),
        legend=[
            *flown,
            *([SceneElement.PLAN] if run.scene.plans else []),
            *([SceneElement.ESTIMATE] if run.scene.has_ghost() else []),
        ],
    )


def _plain(config: object, part: str) -> str:
    """Return the name of a plug-in, only the class for a third-party one."""
    record = config.get(part) if isinstance(config, dict) else None
    name = str(record.get("name", "")) if isinstance(record, dict) else ""
    return name.rpartition(":")[2].rpartition(".")[2]


def _value(label: str, value: float) -> tuple[str, str, str]:
    """A state's name, value and unit: "heading [rad]" is 0.41 rad."""
    name, _, unit = label.partition(" [")
    unit = unit.rstrip("]")
    return name.replace("_", " "), f"{value:.3g}{f' {unit}' if unit not in ('', '-') else ''}", ""
