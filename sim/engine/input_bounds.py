"""Saturation of the input of a vehicle to its bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signal_names import name_and_unit
from mathnavi.interfaces.signals import Array

ROUND_OFF = 1e-9  # relative excess of an input that is not worth an event


def input_bound(
    name: str, input_max: float | Array, size: int, names: Sequence[str] = ()
) -> Callable[[Array], tuple[Array, str]]:
    """Return a function of an input (nu,) to the saturated input (nu,) and a message; "" if nothing was saturated.

    ``names`` are the "name [unit]" of the inputs, which the message has; without them they are numbered.
    """
    parted = [name_and_unit(each) for each in names or [f"input {k + 1}" for k in range(size)]]
    limits = np.asarray(input_max, dtype=np.float64)
    if limits.shape not in ((), (size,)) or not (limits > 0.0).all():
        raise ArgumentError(f"vehicle {name!r}: input_max = {input_max!r}; allowed: one number > 0, or {size} of them")

    def length_bounded(command: Array) -> tuple[Array, str]:
        length, longest = math.sqrt(command.dot(command)), float(limits)
        if length <= longest:
            return command, ""
        clipped = length > longest * (1.0 + ROUND_OFF)
        message = f"an input of length {length:.6g} was shortened to {longest:.6g}" if clipped else ""
        return command * (longest / length), message

    def each_bounded(command: Array) -> tuple[Array, str]:
        excess = np.abs(command) > limits * (1.0 + ROUND_OFF)
        beyond = (
            f"{own} = {command[k]:.6g}{f' {unit}' if unit else ''} is beyond {limits[k]:.6g}"
            for k, (own, unit) in enumerate(parted)
            if excess[k]
        )
        return np.clip(command, -limits, limits), ", ".join(beyond) if excess.any() else ""

    return each_bounded if limits.shape else length_bounded
