"""Identification of a mechanism from recorded logs: parameters of its joints, tested on other motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.estimators.identification.identify import (
    Identification,
    IdentificationConfig,
    JointLog,
    identify_joints,
)
from mathnavi.interfaces.errors import FieldError, LogError
from mathnavi.interfaces.failures import raising
from mathnavi.interfaces.fields import configured
from mathnavi.interfaces.signal_names import name_and_unit
from mathnavi.sim.logs.formats import read_log
from mathnavi.sim.logs.recorded_log import Disorder, RecordedLog

POSITION, INPUTS = "position", "inputs"


def identify(
    log: str | Path | RecordedLog | Sequence[str | Path | RecordedLog],
    mechanism: str | Path,
    *,
    position: str | Sequence[str],
    inputs: str | Sequence[str],
    test: str | Path | RecordedLog | Sequence[str | Path | RecordedLog] = (),
    units: Mapping[str, str] | None = None,
    disorder: Disorder = "refuse",
    **fields: Any,
) -> Identification:
    """Identify the joints of an arm from its log: gain of each motor, inertia of its rotor, friction, offset.

    The inertial parameters of the links are those of the model.

    Args:
        log: the log that is fitted, or several: a file, or what ``read_log`` has read.
        mechanism: name, or path of an MJCF file; "menagerie:NAME" is a robot of MuJoCo Menagerie.
        position: signals of the positions of the joints, in the order of the model.
        inputs: signals of the currents or torques of their motors, in the same order.
        test: logs on which the parameters are tested; without any, the last quarter of each log.
        units: units of signals by their names, as "deg".
        disorder: "refuse" stamps that do not increase, or "sort" them.
        **fields: fields of ``IdentificationConfig``: ``gains`` [N m or N, per unit of the input], 1 for torques;
            ``half_window`` [s] and ``degree`` of the smoothing; ``slowest`` [rad/s, m/s]; ``hold_out``;
            ``longest_offset`` [s].

    Returns:
        The parameters, with intervals of 95 %, and what they leave of the inputs. ``model()`` is the mechanism with
        them, which ``mn.VelocityObserver`` takes, and ``document()`` all numbers, for JSON.

    Raises:
        LogError: for a log that cannot be read, lacks a signal, is too short, or does not show a gain.
        FieldError: for a mechanism that cannot be read or has other joints than hinges and slides, and for a field.
    """
    with raising(FieldError):
        config = configured(IdentificationConfig(), fields)
    fitted, tested = (
        [_joint_log(each, position, inputs, units or {}, disorder) for each in _listed(given)] for given in (log, test)
    )
    if not fitted:
        raise LogError("log = (); allowed: one log or more")
    found = [name_and_unit(each)[1] for each in _signals(_recorded(_listed(log)[0]), inputs)]
    return identify_joints(fitted, mechanism, config, tested, found)


def _listed(given: Any) -> list[Any]:
    return [given] if isinstance(given, (str, Path, RecordedLog)) else list(given)


def _recorded(given: str | Path | RecordedLog) -> RecordedLog:
    return given if isinstance(given, RecordedLog) else read_log(given)


def _joint_log(
    given: str | Path | RecordedLog, position: str | Sequence[str], inputs: str | Sequence[str],
    units: Mapping[str, str], disorder: Disorder,
) -> JointLog:  # fmt: skip
    """Positions and inputs as sensors of one log; inputs with other stamps are interpolated to the positions."""
    recorded = _recorded(given)
    own = recorded.sensor_log(readings={POSITION: position, INPUTS: inputs}, units=units, disorder=disorder)
    q, u = own.readings[POSITION], own.readings[INPUTS]
    there = np.isfinite(q).all(axis=1)
    if not there.any():
        raise LogError(f"{recorded.source}: no reading has all positions; allowed: {np.shape(q)[1]} numbers in a row")
    t, read = own.t[there], np.isfinite(u).all(axis=1)
    if not read.any():
        raise LogError(f"{recorded.source}: no reading has all inputs; allowed: {np.shape(u)[1]} numbers in a row")
    at = np.column_stack([np.interp(t, own.t[read], column) for column in u[read].T])
    outside = (t < own.t[read][0]) | (t > own.t[read][-1])
    at[outside] = np.nan
    return JointLog(recorded.source, t, q[there], at)


def _signals(recorded: RecordedLog, wanted: str | Sequence[str]) -> list[str]:
    """Signals as the log writes them, with their units."""
    names = [wanted] if isinstance(wanted, str) else list(wanted)
    found: list[str] = []
    for name in names:
        if name in recorded.channels:
            found += recorded.channels[name].signals
            continue
        last = name.rpartition(":")[2]
        signals = (each for own in recorded.channels.values() for each in own.signals)
        found += [each for each in signals if last in (each, each.partition(" [")[0])][:1]
    return found
