"""Boundary between the loop and a plug-in: whose code it is does not matter here.

What goes in cannot be changed there: its arrays lie over immutable memory, so that no ``setflags`` of an array or of
its base makes them writable, and the object that holds them is the plug-in's own copy. What comes out is converted and
checked here, once: type, shape, finite numbers, a symmetric covariance, a time that is neither in the future nor older
than declared. Whatever is refused, raised or missing is one value, ``Unusable``, with its reason.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import islice
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import (
    NOTHING,
    Array,
    Estimate,
    Plan,
    PlanRequest,
    Status,
    where_raised,
)

T = TypeVar("T")
Number = TypeVar("Number", bound=np.generic)

_METHODS = ("update", "plan", "monitor", "command", "exchange", "propose", "admits", "adopted", "start", "events")
_HOUSE = __name__.partition(".")[0]
_MOST_EVENTS = 1000
_OF_THE_LOOP = (Status.INITIALISING, Status.DEGRADED, Status.LOST, Status.LATE, Status.NOT_ADMITTED)
_ROUNDING = 1e-6  # [s] of a time
_RELATIVE = 1e-6  # rounding of the length of a command
_FINITE = "finite numbers, whose squares are finite too"
_SYMMETRIC = 1e-6  # share of the greatest variance by which a covariance may differ from its transpose


@dataclass(frozen=True)
class Unusable:
    """Answer of a plug-in that cannot be used."""

    reason: str
    status: Status = Status.RAISED  # or MALFORMED, for an answer that says nothing

    @property
    def plan(self) -> Plan:
        """The failed plan in place of a planner's answer."""
        return Plan.failure(self.status, self.reason)


class RefusedError(ValueError):
    """Reason why an answer is refused."""

    def __init__(self, reason: str, status: Status = Status.MALFORMED) -> None:
        super().__init__(reason)
        self.status = status


def answered(call: Callable[..., T], *given: Any) -> T | Unusable:
    """Return what a plug-in answers, or that it raised. KeyboardInterrupt passes."""
    try:
        return call(*given)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # such as a task that was cancelled
        return raised(error)


def raised(error: BaseException) -> Unusable:
    """Return in place of an answer what a plug-in raised."""
    return Unusable(f"{type(error).__name__}: {_said(error)}{where_raised(error)}")


def _said(error: BaseException) -> str:
    """Return the message of an exception, whose ``__str__`` may raise in turn."""
    try:
        return str(error)
    except BaseException:
        return "its message cannot be printed"


def checked(check: Callable[[], T]) -> T | Unusable:
    """Return an answer as ``check`` converts it; whatever an object of a plug-in does meanwhile makes it unusable."""
    try:
        return check()
    except RefusedError as error:
        return Unusable(str(error), error.status)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        return Unusable(f"{type(error).__name__}: {_said(error)}", Status.MALFORMED)


def guest(part: Any) -> str:
    """Name of the class of a plug-in that is not mathnavi's own, or one of whose methods was replaced; "" otherwise.

    A part of mathnavi that only passes on what another answers names that one as ``wrapped``.
    """
    while _is_own(type(part)) and (inner := getattr(part, "wrapped", None)) is not None:
        part = inner
    if _is_own(type(part)) and not any(callable(getattr(part, "__dict__", {}).get(method)) for method in _METHODS):
        return ""
    return re.sub(r"\W", "_", type(part).__qualname__.rpartition(".")[2])


def _is_own(kind: type) -> bool:
    """Return True for a class of mathnavi, unless it says itself that it is a ``guest``."""
    return kind.__module__.partition(".")[0] == _HOUSE and not getattr(kind, "guest", False)


def signed(kinds: Sequence[str], name: str) -> tuple[str, ...]:
    """Return kinds of events that a plug-in reports, with its name (``guest``): they look like no one else's."""
    return tuple(f"{name}: {' '.join(str(kind).split())}" if name else str(kind) for kind in kinds)


# ---- what goes in


def locked(array: NDArray[Number]) -> NDArray[Number]:
    """Return a copy of an array of numbers over immutable memory, which no one can make writable."""
    if array.dtype.kind not in "biuf":
        raise RefusedError(f"an array of {array.dtype}; allowed: numbers")
    return array.view() if _is_locked(array) else np.frombuffer(array.tobytes(), array.dtype).reshape(array.shape)


def _is_locked(array: NDArray[Any]) -> bool:
    """Return True for an array over immutable memory. Its shape may be changed all the same: what is lent is a view."""
    base: Any = array
    while type(base) is np.ndarray:
        base = base.base
    return isinstance(base, bytes)


def numbers(values: Any) -> Array:
    """Return a copy of what a plug-in means as real numbers, (...) float64.

    Strings, complex numbers and masked values are refused, of which NumPy would make numbers in silence.
    """
    array = np.ma.filled(values, np.nan) if isinstance(values, np.ma.MaskedArray) else np.asarray(values)
    if array.dtype.kind not in "biuf":
        raise RefusedError(f"{values!r:.60} is an array of {array.dtype}; allowed: numbers")
    return np.array(array, dtype=np.float64)


def lent(part: Any) -> Any:
    """Return a copy of a mission, or of what a message carries, for a plug-in: nothing in it is shared and mutable.

    Of dataclasses each field is copied so, of tuples, lists and mappings each entry; arrays are locked. What is none of
    these, a model of MuJoCo for instance, is passed on.
    """
    if isinstance(part, np.ndarray):
        return locked(part) if part.dtype.kind in "biuf" else part.copy()
    if dataclasses.is_dataclass(part) and not isinstance(part, type):
        twin = object.__new__(type(part))
        for field in dataclasses.fields(part):
            object.__setattr__(twin, field.name, lent(getattr(part, field.name)))
        return twin
    if isinstance(part, tuple):
        return type(part)(*map(lent, part)) if hasattr(part, "_fields") else tuple(map(lent, part))
    if isinstance(part, list):
        return list(map(lent, part))
    if isinstance(part, dict):
        return {key: lent(value) for key, value in part.items()}
    return part


def own_copy(estimate: Estimate) -> Estimate:
    """Return an estimate for a plug-in: its arrays are locked, and it is an object of the plug-in's own."""
    covariance = None if estimate.covariance is None else locked(estimate.covariance)
    extra = {name: locked(np.asarray(values)) for name, values in estimate.extra.items()}
    return Estimate(estimate.t, locked(estimate.x), covariance, estimate.status, extra, estimate.message)


def handed(request: PlanRequest) -> PlanRequest:
    """Return a request for a plug-in, whose estimate, plan and messages are its own objects, locked."""
    plan = None if request.current is None else locked_plan(request.current)
    return PlanRequest(request.t, request.t_start, own_copy(request.estimate), plan, lent(request.messages))


def locked_plan(plan: Plan) -> Plan:
    """Return a copy of a plan with locked arrays."""
    t, x, u = locked(numbers(plan.t)), locked(numbers(plan.x)), locked(numbers(plan.u))
    phase = locked(np.asarray(plan.phase, np.int64))
    return Plan(t, x, u, phase, plan.status, plan.message, plan.ready, plan.cost, plan.solve_ms, plan.notes)


# ---- what comes out


def usable_estimate(
    answer: Any,
    t: float,
    before: Estimate | None = None,
    size: int | None = None,
    age: float = math.inf,
    unflyable: Callable[[Estimate], str] | None = None,
    *,
    own: bool = False,
) -> Estimate | Unusable:
    """Return an estimator's answer at t [s], with arrays of the loop's own and of the sizes of the one ``before``.

    ``size`` is nx if that is known. Its time may be ``age`` [s] past. ``unflyable`` says what it lacks, "" if nothing.
    An answer of mathnavi's ``own`` parts is returned unchanged if it can be used so, for they make new arrays for every
    answer.
    """
    if own and before is not None and _usable_as_it_is(answer, t, before, age, unflyable):
        usable: Estimate = answer
        return usable
    with np.errstate(over="ignore"):  # of squares
        return checked(lambda: _estimate(answer, t, before, size, age, unflyable))


def _usable_as_it_is(
    answer: Any, t: float, before: Estimate, age: float, unflyable: Callable[[Estimate], str] | None
) -> bool:
    """Return True for an estimate in which there is nothing to convert; called at every control step."""
    if not (isinstance(answer, Estimate) and isinstance(answer.status, Status)):
        return False
    x, P = answer.x, answer.covariance
    return (
        t - age - _ROUNDING <= answer.t <= t + _ROUNDING
        and type(x) is np.ndarray
        and x.shape == before.x.shape
        and math.isfinite(x.dot(x))
        and (P is None or P is before.covariance or (bool(P.diagonal().min() >= 0.0) and P.tobytes() == P.T.tobytes()))
        and (unflyable is None or not unflyable(answer))
    )


def _estimate(
    answer: Any,
    t: float,
    before: Estimate | None,
    size: int | None,
    age: float,
    unflyable: Callable[[Estimate], str] | None,
) -> Estimate:
    if not isinstance(answer, Estimate):
        raise RefusedError(f"update() returned {type(answer).__name__}; allowed: Estimate")
    if not isinstance(answer.status, Status):
        raise RefusedError(f"the estimate's status is {answer.status!r}; allowed: a Status")
    then = float(answer.t)
    if not t - age - _ROUNDING <= then <= t + _ROUNDING:
        oldest = f", and no older than {age:.3g} s" if age < math.inf else ""
        raise RefusedError(f"the estimate is of {then!r} s; allowed: {t:.9g} s or before{oldest}")
    x = numbers(answer.x)
    if x.ndim != 1 or (size is not None and len(x) != size) or (before is not None and len(x) != len(before.x)):
        nx = "nx" if size is None else size
        allowed = f"({nx},)" if before is None else f"{before.x.shape}, as before"
        raise RefusedError(f"the estimate's state has shape {x.shape}; allowed: {allowed}")
    if not _finite(x):
        raise RefusedError(f"the estimate is {x.tolist()}; allowed: {_FINITE}")
    covariance = None if answer.covariance is None else _covariance(answer.covariance)
    extra = _extra(answer.extra, NOTHING if before is None else before.extra) if answer.extra else NOTHING
    made = Estimate(then, x, covariance, answer.status, extra, str(answer.message))
    if unflyable is not None and (reason := unflyable(made)):
        raise RefusedError(reason)
    return made


def _finite(values: Array) -> bool:
    # With their squares, of which norms and feedback are made.
    with np.errstate(over="ignore"):
        return math.isfinite(values.dot(values))


def _covariance(values: Any) -> Array:
    P = numbers(values)
    if P.ndim != 2 or P.shape[0] != P.shape[1]:
        raise RefusedError(f"the estimate's covariance has shape {P.shape}; allowed: (n, n)")
    if (P.diagonal() < 0.0).any():  # NaN says that a variance is not known
        raise RefusedError(f"the variances of the estimate are {P.diagonal().tolist()}; allowed: numbers >= 0")
    if P.tobytes() == P.T.tobytes():
        return P
    gap = float(np.abs(P - P.T).max())
    if gap > _SYMMETRIC * float(np.abs(P).max()):
        raise RefusedError(f"the estimate's covariance differs from its transpose by {gap:.3g}; allowed: symmetric")
    return 0.5 * (P + P.T)


def _extra(extra: Any, before: Mapping[str, Array]) -> Mapping[str, Array]:
    outputs = {}
    for key, values in dict(extra).items():
        name, output = str(key), np.array(values)
        if output.dtype.kind not in "biuf":
            raise RefusedError(f"the output {name!r} is an array of {output.dtype}; allowed: numbers")
        if output.dtype.kind == "f":
            output = output.astype(np.float64, copy=False)  # compiled code knows no other widths
        if name in before and before[name].shape != output.shape:
            raise RefusedError(
                f"the output {name!r} has shape {output.shape}; allowed: {before[name].shape}, as before"
            )
        outputs[name] = output
    return MappingProxyType(outputs)


def usable_plan(answer: Any, name: str = "") -> Plan | Unusable:
    """Return a planner's answer, its arrays locked; ``name`` is that of a guest.

    A plan's arrays fit together and are finite; what they say is for a certificate to check.
    """
    return checked(lambda: _plan(answer, name))


def _plan(answer: Any, name: str) -> Plan:
    if not isinstance(answer, Plan):
        raise RefusedError(f"plan() returned {type(answer).__name__}; allowed: Plan")
    status, message = answer.status, str(answer.message)
    if not isinstance(status, Enum) or not _is_own(type(status)) or (name and status in _OF_THE_LOOP):
        raise RefusedError(f"the plan's status is {status!r}; allowed: one of a planner")
    if name and not isinstance(status, Status):  # the reasons of a certificate are for a certificate to give
        status, message = Status.INFEASIBLE, f"{status.value}: {message}"
    plan = locked_plan(answer)
    t, x, u, phase = plan.t, plan.x, plan.u, plan.phase
    if plan.ok:
        k = phase.size
        if not (
            k
            and t.shape == (k + 1,)
            and phase.shape == (k,)
            and x.ndim == u.ndim == 2
            and len(x) == len(u) + 1 == k + 1
        ):
            shapes = f"t {t.shape}, x {x.shape}, u {u.shape}, phase {phase.shape}"
            raise RefusedError(f"the plan's arrays are {shapes}; allowed: (K + 1,), (K + 1, nx), (K, nu), (K,)")
        for part, values in (("t", t), ("x", x), ("u", u)):
            if not np.isfinite(values).all():
                raise RefusedError(f"the plan's {part} is not finite", Status.NOT_FINITE)
    return dataclasses.replace(
        plan,
        status=status,
        message=message,
        ready=float(answer.ready),
        cost=float(answer.cost),
        solve_ms=float(answer.solve_ms),
        notes=signed(answer.notes, name),
    )


def usable_command(
    answer: Any, shape: tuple[int, ...], longest: float = math.inf, *, own: bool = False
) -> Array | Unusable:
    """Return a tracker's answer (nu,) as an array of the loop's own; ``longest`` is the greatest length allowed.

    An answer of mathnavi's ``own`` parts is returned unchanged if it can be used so.
    """
    if own and type(answer) is np.ndarray and answer.shape == shape and answer.dtype == np.float64:
        square = answer.dot(answer)
        if square <= longest * longest and square < math.inf:
            return answer
    return checked(lambda: _command(answer, shape, longest))


def _command(answer: Any, shape: tuple[int, ...], longest: float) -> Array:
    command = numbers(answer)
    if command.shape != shape:
        raise RefusedError(f"the command has shape {command.shape}; allowed: {shape}")
    if not _finite(command):
        raise RefusedError(f"the command is {command.tolist()}; allowed: {_FINITE}")
    if command.dot(command) > (longest * (1.0 + _RELATIVE)) ** 2:
        raise RefusedError(f"the command is {command.tolist()}; allowed: a length of at most {longest:g}")
    return command


def usable_events(call: Callable[[], Any], name: str) -> tuple[tuple[str, str], ...] | Unusable:
    """Return kind and message of the events that a plug-in reports, with its name."""
    answer = answered(call)
    if isinstance(answer, Unusable) or (type(answer) in (list, tuple) and not answer):
        return answer or ()
    return checked(lambda: signed_events(answer, name))


def signed_events(answer: Any, name: str) -> tuple[tuple[str, str], ...]:
    """Return pairs of kind and message as text, with the name of their plug-in; RefusedError for too many."""
    events = tuple((str(kind), str(message)) for kind, message in islice(answer, _MOST_EVENTS + 1))
    if len(events) > _MOST_EVENTS:
        raise RefusedError(f"more than {_MOST_EVENTS} events at one step; allowed: no more")
    return tuple(zip(signed([kind for kind, _ in events], name), (text for _, text in events), strict=True))
