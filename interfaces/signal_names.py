"""Names of the signals of a vehicle, said once: log, report, browser, tables and messages all use them.

A number is called "name [unit]": "heading [rad]"; one without a unit has "[-]" or no brackets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

AXES = {3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}
"""names of the numbers of a vector and of a quaternion, by their count"""


@dataclass(frozen=True)
class SignalNames:
    """Names of a vehicle's signals, "name [unit]" for each number; empty where they are not declared."""

    states: tuple[str, ...] = ()  # (nx,)
    inputs: tuple[str, ...] = ()  # (nu,)
    readings: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # of each sensor's numbers
    estimates: tuple[str, ...] = ()  # of the numbers of its estimator's estimate
    estimands: tuple[str, ...] = ()  # of what there is to estimate, whose true values are in the log
    figures: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """names of the numbers of an estimate's further figures, by figure; each number is drawn in a chart of its own"""
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """names, without units, of the states, inputs or estimates that are drawn in one chart, by its title"""

    def over(self, others: SignalNames) -> SignalNames:
        """Return these names, and in the place of those that are not declared the ``others``."""
        groups = {title: names for title, names in others.groups.items() if not self._grouped(names)}
        return SignalNames(
            self.states or others.states,
            self.inputs or others.inputs,
            {**others.readings, **self.readings},
            self.estimates or others.estimates,
            self.estimands or others.estimands,
            {**others.figures, **self.figures},
            {**groups, **self.groups},
        )

    def checked(self, where: str, states: int, inputs: int, readings: Mapping[str, int]) -> SignalNames:
        """Return these names; ArgumentError if they are not as many as the numbers they name, or of no sensor."""
        for kind, names, size in (("states", self.states, states), ("inputs", self.inputs, inputs)):
            if names and len(names) != size:
                raise ArgumentError(f"{where}: signals.{kind} = {list(names)}; allowed: {size} names, or none")
        for sensor, names in self.readings.items():
            if sensor not in readings:
                raise ArgumentError(
                    f"{where}: signals.readings names {sensor!r}; {allowed_for(sensor, list(readings))}"
                )
            if len(names) != readings[sensor]:
                raise ArgumentError(
                    f"{where}: signals.readings[{sensor!r}] = {list(names)}; allowed: {readings[sensor]} names"
                )
        return self

    def of_estimate(self, size: int) -> tuple[str, ...]:
        """Return the names of the numbers of an estimate; none if they are not known.

        They are those of its estimator, of the states or of the estimands, the first that are as many as its ``size``.
        """
        return next((each for each in (self.estimates, self.states, self.estimands) if len(each) == size), ())

    def _grouped(self, names: Sequence[str]) -> bool:
        """True if one of the names is in a group that is declared here."""
        return any(name in own for own in self.groups.values() for name in names)


UNNAMED = SignalNames()


def name_and_unit(words: str) -> tuple[str, str]:
    """Return the name, with spaces, and the unit of "name [unit]"; "" where there is no unit."""
    name, _, unit = words.partition(" [")
    unit = unit.removesuffix("]")
    return name.replace("_", " "), "" if unit == "-" else unit


def difference(words: str, value: Array, reference: Array) -> Array:
    """Return a value less a reference, both (n,), of a signal "name [unit]"; of an angle [rad] from -pi to pi."""
    found: Array = value - reference
    return np.arctan2(np.sin(found), np.cos(found)) if name_and_unit(words)[1] == "rad" else found


def figure_names(estimator: object) -> dict[str, tuple[str, ...]]:
    """Return the names that an estimator gives to the numbers of its further figures, by figure; none if it gives none.

    Raises ArgumentError for ``figures`` that are something else.
    """
    declared = getattr(estimator, "figures", None)
    if declared is None:
        return {}
    if not isinstance(declared, Mapping) or not all(
        isinstance(names, list | tuple) and all(isinstance(name, str) for name in names) for names in declared.values()
    ):
        raise ArgumentError(f"the estimator has figures = {declared!r:.80}; allowed: names of its numbers, by figure")
    return {str(figure): tuple(names) for figure, names in declared.items()}


def numbered(name: str, size: int, unit: str = "") -> tuple[str, ...]:
    """Return the names of the numbers of a signal: its own, the axes of a vector or a quaternion, else 1, 2, ..."""
    own = (name,) if size == 1 else AXES.get(size, tuple(str(k + 1) for k in range(size)))
    return tuple(f"{each} [{unit}]" if unit else each for each in own)
