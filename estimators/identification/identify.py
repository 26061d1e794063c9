"""Identification of a mechanism from logs of its motion: parameters with intervals, and how they fit other motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import mujoco
import numpy as np
from annotated_types import Interval

from mathnavi.estimators.identification.joint_parameters import (
    GAIN,
    NAMES,
    JointFit,
    SmoothedMotion,
    fit_joint,
    moving,
    predicted,
    smoothed_motion,
    time_offset,
)
from mathnavi.interfaces.bounds import FINITE, Fraction, NonNegative, Positive, configuration
from mathnavi.interfaces.errors import FieldError, LogError
from mathnavi.interfaces.field_table import TOGETHER, ValueName
from mathnavi.interfaces.joint_states import SLIDE
from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.driven_joints import DrivenJoint, driven_spec, joint_names, mechanism_alone
from mathnavi.models.mechanism.inertial_regressor import InertialRegressor

_FEWEST = 100  # stamps of a motion
_ROTARY = ("N m", "kg m^2", "N m s/rad", "N m", "N m")
_LINEAR = ("N", "kg", "N s/m", "N", "N")


@configuration
class IdentificationConfig:
    """Fields of an identification."""

    gains: Annotated[tuple[float, ...], TOGETHER, ValueName("GAIN")] = ()
    """gains of the inputs [N m or N, per unit of the input], one for each joint or one for all, 1 for torques;
    identified if not given"""
    half_window: Positive = 0.1
    """half of the time over which positions and inputs are smoothed [s]"""
    degree: Annotated[int, Interval(ge=2, le=7), FINITE] = 5
    """degree of the polynomials by which they are smoothed"""
    slowest: Positive = 0.05
    """least speed of a joint within the window of a sample that is used [rad/s, m/s]"""
    hold_out: Fraction = 0.25
    """part of the log, at its end, on which the parameters are tested and not fitted, if no other log is given"""
    longest_offset: NonNegative = 0.05
    """longest time between the clocks of inputs and positions that is looked for [s]; 0 for none"""


class JointLog(NamedTuple):
    """Positions and inputs of the joints of a mechanism, with one clock."""

    name: str  # in tables and messages
    t: Array  # (n,) [s], which increase
    q: Array  # (n, nv) [rad, m]
    u: Array  # (n, nv) NaN where it was not read


@dataclass(frozen=True)
class FitResidual:
    """Inputs of a motion less those that the parameters predict, while the joints move."""

    name: str
    rms: Array  # (nv,) root mean square of u - u^ [unit of u]
    share: Array  # (nv,) variance that the parameters explain, of that of u


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """Parameters of the joints of a mechanism, and what they leave of the inputs."""

    mechanism: str
    joints: tuple[str, ...]
    fits: tuple[JointFit, ...]
    fitted: FitResidual
    tested: tuple[FitResidual, ...]  # on motions that were not fitted
    offset: float  # [s] by which the inputs are stamped later than the positions; NaN if not found
    offset_interval: float  # [s] half of its interval of 95 %
    config: IdentificationConfig
    units: tuple[tuple[str, ...], ...] = field(default=())  # (nv, 5) of the parameters, the gain's per unit of u

    def driven_joints(self) -> tuple[DrivenJoint, ...]:
        """Parameters as those of joints with motors."""
        return tuple(DrivenJoint(*(float(each) for each in own.theta)) for own in self.fits)

    def spec(self) -> Any:
        """Return the ``mujoco.MjSpec`` of the mechanism with these parameters; the controls are the inputs."""
        return driven_spec(self.mechanism, self.driven_joints())

    def model(self) -> mujoco.MjModel:
        """Return the ``mujoco.MjModel`` of ``spec``, which ``mn.VelocityObserver`` takes."""
        return self.spec().compile()

    def document(self) -> dict[str, Any]:
        """Return all of it as numbers, lists and dictionaries, for JSON; unknown numbers are None."""
        joints = {}
        for name, own, units in zip(self.joints, self.fits, self.units, strict=True):
            parameters = {
                NAMES[k]: {
                    "value": float(own.theta[k]),
                    "interval": None if np.isnan(own.deviation[k]) else own.interval[:, k].tolist(),
                    "unit": units[k],
                }
                for k in range(len(NAMES))
            }
            joints[name] = {
                "parameters": parameters,
                "held": list(own.held),
                "not_excited": list(own.unseen),
                "singular_values": own.singular_values.tolist(),
            }
        known = not np.isnan(self.offset)
        return {
            "mechanism": self.mechanism,
            "joints": joints,
            "offset_s": {
                "value": self.offset if known else None,
                "interval": [self.offset - self.offset_interval, self.offset + self.offset_interval] if known else None,
            },
            "fitted": _residual_document(self.fitted, self.joints),
            "tested": [_residual_document(each, self.joints) for each in self.tested],
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: joint, parameter, value, half of its interval or "held", unit."""
        found: list[tuple[str, ...]] = []
        for name, own, units in zip(self.joints, self.fits, self.units, strict=True):
            for k, parameter in enumerate(NAMES):
                half = own.interval[1, k] - own.theta[k]
                error = "held" if np.isnan(own.deviation[k]) else f"{half:.2g}"
                found.append((name, parameter, f"{own.theta[k]:.4g}", error, units[k]))
        return found

    def residual_rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: motion, joint, root mean square of what is left [N m, N], explained variance [%]."""
        return [
            (each.name, name, f"{abs(own.theta[GAIN]) * each.rms[j]:.3g}", f"{100.0 * each.share[j]:.1f}")
            for each in (self.fitted, *self.tested)
            for j, (name, own) in enumerate(zip(self.joints, self.fits, strict=True))
        ]

    def remarks(self) -> list[str]:
        """Sentences on what was held, what the motion does not excite, and on the clocks."""
        found = []
        for name, own in zip(self.joints, self.fits, strict=True):
            found += [f"{name}: {each}" for each in own.held]
            found += [f"{name}: the motion does not tell apart {each}" for each in own.unseen]
        if self.config.longest_offset:
            most, late, half = (1e3 * each for each in (self.config.longest_offset, self.offset, self.offset_interval))
            found.append(
                f"time offset of the inputs not found within {most:.3g} ms"
                if np.isnan(self.offset)
                else f"inputs are stamped {late:.2g} ± {half:.2g} ms after the positions"
            )
        return found

    def __repr__(self) -> str:
        rows = [("joint", "parameter", "value", "±", "unit"), *self.rows()]
        left = [("motion", "joint", "left [N m, N]", "explained [%]"), *self.residual_rows()]
        return "\n".join([self.mechanism, *_aligned(rows), *_aligned(left), *self.remarks()])


def identify_joints(
    logs: Sequence[JointLog],
    mechanism: str | Path,
    config: IdentificationConfig,
    tests: Sequence[JointLog] = (),
    input_units: Sequence[str] = (),
) -> Identification:
    """Identify the parameters of the joints of a mechanism.

    Args:
        logs: motions that are fitted, with one position and one input for each joint, in the order of the model.
        mechanism: name or MJCF file; links have the inertial parameters that it says.
        config: fields.
        tests: motions that the parameters are tested on; without any, the last part of each of ``logs``.
        input_units: units of the inputs, for tables.

    Raises:
        FieldError: for a mechanism that cannot be read or that has other joints than hinges and slides, and for a
            number of gains that is not that of the joints.
        LogError: for logs of another number of joints, that are too short, or that do not show a gain.
    """
    model = mechanism_alone(mechanism)
    names = joint_names(model)
    gains = _gains(config.gains, names)
    regressor = InertialRegressor(model)
    motions = [_motion(log, names, regressor, config) for log in logs]
    held_out = [_motion(log, names, regressor, config) for log in tests]
    labels = [log.name for log in tests]
    if not tests and config.hold_out:
        cuts = [round(len(motion.t) * (1.0 - config.hold_out)) for motion in motions]
        held_out = [motion.part(slice(cut, None)) for motion, cut in zip(motions, cuts, strict=True)]
        labels = [f"last {100.0 * config.hold_out:.0f} % of {log.name}" for log in logs]
        motions = [motion.part(slice(None, cut)) for motion, cut in zip(motions, cuts, strict=True)]
    whole = SmoothedMotion(*(np.concatenate(each) for each in zip(*motions, strict=True)))
    fits = tuple(
        fit_joint(whole, j, name, config.slowest, gain, float(model.dof_armature[j]))
        for j, (name, gain) in enumerate(zip(names, gains, strict=True))
    )
    theta = [own.theta for own in fits]
    offset = (float("nan"), float("nan"))
    if config.longest_offset:
        offset = time_offset(motions, theta, config.slowest, config.longest_offset)
    residuals = [
        _residual(name, motion, theta, config.slowest)
        for name, motion in zip(["fitted", *labels], [whole, *held_out], strict=True)
    ]
    per = list(input_units) if len(input_units) == len(names) else [""] * len(names)
    units = tuple(_units(model, j, unit) for j, unit in enumerate(per))
    return Identification(str(mechanism), names, fits, residuals[0], tuple(residuals[1:]), *offset, config, units)


def _motion(
    log: JointLog, names: tuple[str, ...], regressor: InertialRegressor, config: IdentificationConfig
) -> SmoothedMotion:
    n = len(names)
    for what, values in (("positions", log.q), ("inputs", log.u)):
        if values.shape[1] != n:
            raise LogError(f"{log.name} has {values.shape[1]} {what}; allowed: {n}, of the joints {', '.join(names)}")
    good = np.isfinite(log.q).all(axis=1) & np.isfinite(log.u).all(axis=1)
    t, q, u = log.t[good], log.q[good], log.u[good]
    motion = smoothed_motion(t, q, u, config.half_window, config.degree)
    if len(motion.t) < _FEWEST:
        raise LogError(
            f"{log.name}: {len(motion.t)} of {len(t)} readings have enough others within {config.half_window:g} s; "
            f"allowed: {_FEWEST} or more, with a longer half_window or a log of a higher rate"
        )
    return motion._replace(torque=regressor.torque(motion.q, motion.v, motion.a))


def _gains(given: tuple[float, ...], names: tuple[str, ...]) -> Sequence[float | None]:
    if not given:
        return [None] * len(names)
    if len(given) not in (1, len(names)) or not np.isfinite(given).all() or 0.0 in given:
        raise FieldError(
            f"gains = {given}; allowed: one number, or {len(names)}, of {', '.join(names)}, none of them 0"
        )
    return given * (len(names) if len(given) == 1 else 1)


def _residual(name: str, motion: SmoothedMotion, theta: Sequence[Array], slowest: float) -> FitResidual:
    rms, share = np.full(len(theta), np.nan), np.full(len(theta), np.nan)
    for j, own in enumerate(theta):
        rows = moving(motion, j, slowest)
        if len(rows):
            left = (motion.u[:, j] - predicted(motion, j, own))[rows]
            rms[j] = np.sqrt(np.mean(np.square(left)))
            share[j] = 1.0 - float(np.mean(np.square(left))) / max(float(motion.u[rows, j].var()), 1e-300)
    return FitResidual(name, rms, share)


def _residual_document(own: FitResidual, joints: Sequence[str]) -> Mapping[str, Any]:
    return {
        "motion": own.name,
        "rms": {name: _number(value) for name, value in zip(joints, own.rms, strict=True)},
        "explained": {name: _number(value) for name, value in zip(joints, own.share, strict=True)},
    }


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _units(model: mujoco.MjModel, j: int, unit: str) -> tuple[str, ...]:
    gain, *others = _LINEAR if int(model.jnt_type[j]) == SLIDE else _ROTARY
    return (f"{gain}/{unit or 'input'}", *others)


def _aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
