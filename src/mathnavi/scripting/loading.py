"""Loader of a run from its folder: the arrays of log.npz become the recording that they were written from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array, Estimate, Event, Plan
from mathnavi.scripting.run_result import RunResult
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.records.figure_names import SHORTFALL
from mathnavi.sim.records.log_arrays import ACTIVATION, CRAMER_RAO, ESTIMANDS
from mathnavi.sim.records.run_folder import (
    read_activation_names,
    read_arrays,
    read_record,
    read_signal_names,
    read_state_names,
)
from mathnavi.sim.records.timing import read_timing

_TRUTH = "truth.x"
_OF_ESTIMATES, _OF_READINGS = "estimate.", "measurement."


def load(folder: str | Path, *, trust: bool = False) -> RunResult:
    """Load the run in a folder written by ``mathnavi run`` or ``RunResult.save``, of this version or an earlier one.

    Its arrays are bit for bit those of the log. With ``trust``, video, report and plot import the drawing that the
    folder names even if it is not installed; it runs with your rights. Raises RunFolderError if the folder, or one of
    its files, is missing or broken.
    """
    try:
        config, summary, events = read_record(folder)
        arrays = read_arrays(folder)
        states = read_state_names(folder)
        recording = _recording(arrays, list(events), states, summary)
        timing = read_timing(Path(folder))
        recording.activation_names = read_activation_names(folder)
        recording.signals = read_signal_names(folder)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunFolderError(f"{str(folder)!r} is not the folder of a run: {error}") from error
    success = SHORTFALL not in summary
    return RunResult(recording, summary, config, success, Path(folder), timing=timing, trusted=trust)


def _recording(
    arrays: Mapping[str, Array], events: list[Event], states: Mapping[str, tuple[str, ...]], summary: Mapping[str, Any]
) -> Recording:
    """Return the recording; arrays of a single vehicle have no prefix, those of a fleet their vehicle's name."""
    t = arrays["t"]
    single = _TRUTH in arrays
    truths, agents, bounds, activations, estimands = {}, {}, {}, {}, {}
    for name in states:
        prefix = "" if single else f"{name}."
        own = {key.removeprefix(prefix): rows for key, rows in arrays.items() if key != "t" and key.startswith(prefix)}
        truths[name] = own[_TRUTH]
        if "command.u" in own:
            agents[name] = _agent(name, events, own, int(summary.get("replans", 0)))
        if CRAMER_RAO in own:
            bounds[name] = own[CRAMER_RAO]
        if ACTIVATION in own:
            activations[name] = own[ACTIVATION]
        if ESTIMANDS in own:
            estimands[name] = own[ESTIMANDS]
    return Recording(t, truths, agents, events, dict(states), len(t), bounds, activations, estimands=estimands)


def _agent(name: str, events: list[Event], own: Mapping[str, Array], requests: int) -> AgentRecorder:
    readings = {key.removeprefix(_OF_READINGS): rows for key, rows in own.items() if key.startswith(_OF_READINGS)}
    return AgentRecorder(name, events, own["command.u"], readings, _estimates(own), _plans(own), requests)


def _estimates(own: Mapping[str, Array]) -> list[Estimate]:
    if "estimate.t" not in own:
        return []
    extra = {
        key.removeprefix(_OF_ESTIMATES): rows
        for key, rows in own.items()
        if key.startswith(_OF_ESTIMATES) and key not in ("estimate.t", "estimate.x")
    }
    return [
        Estimate(float(t), x, extra={key: rows[k] for key, rows in extra.items()})
        for k, (t, x) in enumerate(zip(own["estimate.t"], own["estimate.x"], strict=True))
    ]


def _plans(own: Mapping[str, Array]) -> list[tuple[float, Plan]]:
    if "plan.offsets" not in own:
        return []
    t, x, u, phase = (own[f"plan.{name}"] for name in ("t", "x", "u", "phase"))
    offsets = own["plan.offsets"].astype(int).tolist()
    return [
        (float(adopted), Plan(t[a:b], x[a:b], u[a : b - 1], phase[a : b - 1].astype(np.int64), cost=float(cost)))
        for a, b, adopted, cost in zip(offsets, offsets[1:], own["plan.adopted"], own["plan.cost"], strict=False)
    ]
