"""Check of position readings against the model of a Lagrangian system: its limits, its motion, its greatest speed.

The readings contradict the model if a joint is beyond its limits most of the time or moves farther than
they are apart, if the model does not explain half of an acceleration, or if the mean speed is several times the
greatest that is declared. They are then read in other ways: hinges in degrees, turns, or the other way round, slides in
millimetres or centimetres, by a gear, quaternions with the scalar last. A way is named if it removes the contradiction.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.plausibility.motion import RecordedMotion, bends, speeds
from mathnavi.estimators.plausibility.units import (
    CENTIMETRES,
    DEGREES,
    MILLIMETRES,
    OTHER_SIGN,
    TURNS,
    Unit,
    fit_only,
    gear,
)
from mathnavi.interfaces.joint_states import UNIT, QuaternionOrder
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold, quaternion_parts
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.mechanism.geometry import MechanismManifold, ScalarJoint

_TURN = 2.0 * math.pi
_SLACK, _SLACK_SHARE = 0.1, 0.1  # [rad, m], and of the distance between limits, by which readings may be beyond them
_OUTSIDE, _INSIDE = 0.5, 0.95  # shares of the readings, beyond limits that they contradict and within those they keep
_TOO_FAR = 1.5  # times the distance between its limits, over which no joint moves
_USED = 0.025  # of that distance, over which joints move at least
_UNEXPLAINED, _EXPLAINED, _EXACT = 0.5, 0.1, 0.05  # shares of the acceleration that the model does not explain
_TOO_FAST = 5.0  # times the greatest declared speed
_GEARS = np.geomspace(8.0, 300.0, 13).tolist()  # ratios that are tried; less may be the error of a mass
_CORRECTIONS = (1.15, 1.07, 1.035, 1.017, 1.008)  # of the best one
_NEARBY = 1.1  # a factor so near does not fit much better than that of a unit
_FEW = 3  # joints, each of which is tried
_GEARED = math.pi  # [rad] over which the readings of a hinge with a gear move
_AS_GOOD = 2.0  # times the least that is left unexplained: the likelier way is taken
_PROMISING = 2.0 * _EXPLAINED  # share in few windows
_QUICK, _FULL = 10, 40  # windows to compare ways by, and to decide by
_ROUNDS, _BETTER = 4, 0.8  # joints that are read in different ways, each of which removes a fifth of what is left

Search = Generator[None, None, "_Fit | None"]


_USUAL = (DEGREES, MILLIMETRES, CENTIMETRES)
_UNITS = {True: (DEGREES, TURNS), False: (MILLIMETRES, CENTIMETRES)}  # of hinges and of slides


@dataclass(frozen=True, eq=False)
class _Way:
    """Way of reading a log: some joints in another unit, or quaternions in another order."""

    units: tuple[tuple[ScalarJoint, Unit], ...] = ()
    order: QuaternionOrder | None = None  # None: as declared

    def apply(self, y: Array, manifold: Manifold) -> Array:
        """Points (N, size) of readings y (N, size); angles go on from turn to turn."""
        points = y.copy()
        for joint, unit in self.units:
            points[:, joint.place] *= unit.factor
        for part in quaternion_parts(manifold):
            if self.order is not None:
                points[:, part] = np.roll(points[:, part], 1 if self.order == "xyzw" else -1, axis=1)
            points[:, part] /= np.linalg.norm(points[:, part], axis=1, keepdims=True)
        for joint in _scalars(manifold):
            if joint.hinge:
                points[:, joint.place] = _continuous(points[:, joint.place], joint)
        return points

    def times(self, factor: float) -> _Way:
        """This way with its units times a factor."""
        return replace(self, units=tuple((joint, gear(factor * unit.factor)) for joint, unit in self.units))

    def and_also(self, joint: ScalarJoint, unit: Unit) -> _Way:
        """This way, and one joint in a unit."""
        others = tuple(each for each in self.units if each[0] != joint)
        return replace(self, units=(*others, (joint, unit)))


@dataclass(frozen=True, eq=False)
class _Fit:
    """Evidence for and against a way of reading."""

    way: _Way
    shares: Array  # (n,) of the acceleration that the model does not explain; NaN where none is seen
    beyond: tuple[ScalarJoint, ...]  # joints that contradict their limits
    within: bool  # whether all joints keep theirs
    speed: float  # [rad/s, m/s] median of the greatest rate

    @property
    def worst(self) -> float:
        """Worst share; 0 where no acceleration is seen."""
        return float(np.nan_to_num(self.shares).max(initial=0.0))

    @property
    def explained(self) -> bool:
        """True if the model explains the accelerations that are seen: the better, the less usual the way."""
        usual = all(unit in _USUAL for _, unit in self.way.units)
        return not np.isnan(self.shares).all() and self.worst <= (_EXPLAINED if usual else _EXACT)


def misread(
    mission: LagrangianMission, motion: RecordedMotion, order: QuaternionOrder = "wxyz"
) -> Generator[None, None, str]:
    """Return the only other way in which the readings fit the mission; "" if they fit unchanged, or not at all.

    Quaternions have their scalar first, if they came in the declared ``order``. It is a generator, each step of which
    takes some milliseconds.
    """
    manifold = mission.system.manifold
    if not (_scalars(manifold) or quaternion_parts(manifold)):
        return ""
    motion = replace(motion, y=_points_or_nan(motion.y, manifold))
    common = _common_ways(manifold, "xyzw" if order == "wxyz" else "wxyz")
    as_is = yield from _fit(mission, motion, _Way(), _FULL)
    if as_is.worst < _UNEXPLAINED and np.isnan(as_is.shares).any():
        motion = replace(motion, longer=True)
        as_is = yield from _fit(mission, motion, _Way(), _FULL)
    if as_is.worst >= _UNEXPLAINED:
        found = yield from _by_motion(mission, motion, as_is, common)
        if found is not None:
            return _sentence(found.way, "the model's motion under the inputs", motion)
    if as_is.beyond:
        found = yield from _by_limits(mission, motion, as_is, common)
        if found is not None:
            return _sentence(found.way, f"the limits of {_names(as_is.beyond)}", motion)
    if as_is.speed > _TOO_FAST * mission.speed_max and not as_is.explained:
        found = yield from _by_speed(mission, motion, common)
        if found is not None:
            fast = f"speed_max = {mission.speed_max:g}, as {as_is.speed:.3g} is the median else,"
            return f"{_sentence(found.way, fast, motion)}, or declare the greater speed_max"
    return ""


def _points_or_nan(y: Array, manifold: Manifold) -> Array:
    """Readings (N, size); rows of NaN for those that are no points."""
    bad: NDArray[np.bool_] = np.logical_not(np.isfinite(y).all(axis=1))
    for part in quaternion_parts(manifold):
        bad |= ~(np.abs(np.linalg.norm(y[:, part], axis=1) - 1.0) <= UNIT)
    return np.where(bad[:, None], np.nan, y)


def _scalars(manifold: Manifold) -> tuple[ScalarJoint, ...]:
    return manifold.scalars if isinstance(manifold, MechanismManifold) else ()


# ---- evidence


def _fit(mission: LagrangianMission, motion: RecordedMotion, way: _Way, count: int) -> Generator[None, None, _Fit]:
    """Evidence about a way of reading, in ``count`` windows."""
    manifold = mission.system.manifold
    read = replace(motion, y=way.apply(motion.y, manifold))
    stride = read.stride(manifold)
    yield
    found, speed = np.full(manifold.dimension, np.nan), 0.0
    if stride:
        over = yield from bends(mission.system, read, stride, count)
        found = over.shares
        if read.longer and not over.informed.all() and (more := read.longer_than(stride)):
            longer = yield from bends(mission.system, read, more, count)
            found = over.and_longer(longer)
        speed = float(np.median(speeds(mission.system, read, stride, count)))
    kept = {joint: _keeps_limits(read.y[:, joint.place], joint) for joint in _scalars(manifold)}
    beyond = tuple(joint for joint, keeps in kept.items() if keeps is False)
    return _Fit(way, found, beyond, all(kept.values()), speed)


def _keeps_limits(values: Array, joint: ScalarJoint) -> bool | None:
    """True if the readings (N,) are within the limits of a joint, False if they contradict them, None between."""
    read, width = values[~np.isnan(values)], joint.high - joint.low
    if not (math.isfinite(width) and len(read)):
        return True
    least, greatest = np.quantile(read, (0.01, 0.99))
    inside = _share_inside(read, joint)
    if greatest - least > _TOO_FAR * width + _SLACK or inside < 1.0 - _OUTSIDE:
        return False
    return True if inside >= _INSIDE else None


def _span(values: Array) -> float:
    return float(np.nanmax(values) - np.nanmin(values))


def _share_inside(read: Array, joint: ScalarJoint) -> float:
    slack = max(_SLACK if joint.hinge else 0.0, _SLACK_SHARE * (joint.high - joint.low))
    return float(np.mean((read >= joint.low - slack) & (read <= joint.high + slack)))


def _continuous(values: Array, joint: ScalarJoint) -> Array:
    """Angles (N,) that go on from turn to turn where an encoder starts again, within the limits of a joint."""
    here = ~np.isnan(values)
    read = values[here]
    if not len(read) or np.ptp(read) > _TURN + _SLACK:  # an encoder that counts turns
        return values
    angles = values.copy()
    if joint.high - joint.low > _TURN:
        angles[here] = np.unwrap(read)
    elif _share_inside(read, joint) < _INSIDE:
        angles[here] += _TURN * np.round((0.5 * (joint.low + joint.high) - read) / _TURN)
    return angles


# ---- the search of another way


def _by_motion(mission: LagrangianMission, motion: RecordedMotion, as_is: _Fit, common: Sequence[_Way]) -> Search:
    """Way in which the model explains the accelerations."""
    fits = []
    for way in common:
        fits.append((yield from _fit(mission, motion, way, _QUICK)))
    if not any(each.explained and each.worst <= _EXACT for each in fits):
        fits.append((yield from _one_by_one(mission, motion, as_is)))
    least = min(map(_total, fits), default=0.0)
    for each in fits:
        if each.worst <= _PROMISING and _total(each) <= _AS_GOOD * least:
            full = yield from _fit(mission, motion, each.way, _FULL)
            if full.explained and not full.beyond and (yield from _is_unit(mission, motion, full)):
                return full
    geared = yield from _geared(mission, motion)
    return geared


def _is_unit(mission: LagrangianMission, motion: RecordedMotion, fit: _Fit) -> Generator[None, None, bool]:
    """True unless another factor than that of the unit fits much better: 50 is not a unit but a gear."""
    if all(unit is OTHER_SIGN for _, unit in fit.way.units):
        return True
    others = []
    for factor in (_NEARBY, 1.0 / _NEARBY):
        others.append((yield from _fit(mission, motion, fit.way.times(factor), _FULL)))
    return _total(fit) <= _AS_GOOD * min(map(_total, others))


def _by_limits(mission: LagrangianMission, motion: RecordedMotion, as_is: _Fit, common: Sequence[_Way]) -> Search:
    """Way in which all joints keep their limits and use some of their range, and move no less like the model."""
    suspects = as_is.beyond
    ways = [_Way(tuple((each, OTHER_SIGN) for each in suspects))]
    ways += [way for way in common if way.order is None]
    ways += [_Way(tuple((each, _UNITS[each.hinge][k]) for each in suspects)) for k in (0, 1)]
    for way in ways:
        units = dict(way.units)
        moves = (
            abs(units[each].factor) * _span(motion.y[:, each.place]) if each in units else 0.0 for each in suspects
        )
        if all(move >= _USED * (each.high - each.low) for move, each in zip(moves, suspects, strict=True)):
            fit = yield from _fit(mission, motion, way, _FULL)
            if fit.within and fit.worst <= max(as_is.worst, _EXPLAINED):
                return fit
    return None


def _by_speed(mission: LagrangianMission, motion: RecordedMotion, common: Sequence[_Way]) -> Search:
    """Way in which the motion is no faster than declared."""
    for way in common:
        if way.units and all(0.0 < unit.factor < 1.0 for _, unit in way.units):
            fit = yield from _fit(mission, motion, way, _FULL)
            if fit.within and fit.speed <= mission.speed_max:
                return fit
    return None


def _common_ways(manifold: Manifold, order: QuaternionOrder) -> list[_Way]:
    """Ways of reading all joints of a kind, the likeliest first."""
    scalars = _scalars(manifold)
    hinges, slides = ([joint for joint in scalars if joint.hinge is kind] for kind in (True, False))
    ways = [_Way(tuple((each, unit) for each in hinges)) for unit in _UNITS[True] if hinges]
    ways += [_Way(tuple((each, unit) for each in slides)) for unit in _UNITS[False] if slides]
    if hinges and slides:
        angles = tuple((each, DEGREES) for each in hinges)
        ways += [_Way((*angles, *((each, unit) for each in slides))) for unit in _UNITS[False]]
    if quaternion_parts(manifold):
        ways += [_Way((), order), *([replace(ways[0], order=order)] if hinges else [])]
    if scalars:
        ways.append(_Way(tuple((each, OTHER_SIGN) for each in scalars)))
    return ways


def _one_by_one(mission: LagrangianMission, motion: RecordedMotion, as_is: _Fit) -> Generator[None, None, _Fit]:
    """Best way in which some joints are read each in its own unit or sign."""
    best = yield from _fit(mission, motion, as_is.way, _QUICK)
    for _ in range(_ROUNDS):
        wrong = np.nan_to_num(best.shares) >= _EXPLAINED
        fits = []
        for joint in _scalars(mission.system.manifold):
            if wrong[joint.coordinate]:
                for unit in (OTHER_SIGN, *_UNITS[joint.hinge]):
                    fits.append((yield from _fit(mission, motion, best.way.and_also(joint, unit), _QUICK)))
        found = min(fits, key=_total, default=best)
        if not _total(found) < _BETTER * _total(best):
            break
        best = found
    return best


def _geared(mission: LagrangianMission, motion: RecordedMotion) -> Search:
    """Way in which hinges are read through a gear, all through the same or one alone."""
    y = motion.y
    turning = [each for each in _scalars(mission.system.manifold) if each.hinge and _span(y[:, each.place]) > _GEARED]
    alone = [[each] for each in turning] if len(turning) <= _FEW else []
    for joints in ([turning] if len(turning) > 1 else []) + alone:
        ways = [
            _Way(tuple((joint, gear(sign / ratio)) for joint in joints)) for ratio in _GEARS for sign in (1.0, -1.0)
        ]
        best = yield from _best(mission, motion, ways)
        for factor in _CORRECTIONS:
            more = yield from _best(mission, motion, [best.way.times(factor), best.way.times(1.0 / factor)])
            best = min(best, more, key=_total)
        if best.worst <= _EXACT:
            full = yield from _fit(mission, motion, best.way, _FULL)
            if full.explained:
                return full
    return None


def _best(mission: LagrangianMission, motion: RecordedMotion, ways: Sequence[_Way]) -> Generator[None, None, _Fit]:
    """Way in which the least is left unexplained."""
    fits = []
    for way in ways:
        fits.append((yield from _fit(mission, motion, way, _QUICK)))
    return min(fits, key=_total)


def _total(fit: _Fit) -> float:
    """Sum of the shares; infinite where nothing is seen."""
    return math.inf if np.isnan(fit.shares).all() else float(np.nansum(fit.shares))


# ---- what is said


def _sentence(way: _Way, what: str, motion: RecordedMotion) -> str:
    """Say in which way alone the readings fit."""
    parts = []
    for unit in dict.fromkeys(unit for _, unit in way.units):
        joints = [joint for joint, other in way.units if other == unit]
        places = [joint.place - motion.first for joint in joints]
        read = motion.y[:, [joint.place for joint in joints]]
        values = f"{np.nanmin(read):.3g} to {np.nanmax(read):.3g}"
        columns = f"column{'s' * (len(joints) > 1)} {', '.join(map(str, places))} ({_names(joints)}, {values})"
        parts.append((unit.name, columns, unit.allowed))
    if way.order is not None:
        parts.append((f"in the order {', '.join(way.order)}", "their quaternions", f'quaternions="{way.order}"'))
    return fit_only(motion.name, what, parts)


def _names(joints: Sequence[ScalarJoint]) -> str:
    return f"joint{'s' * (len(joints) > 1)} {', '.join(each.name for each in joints)}"
