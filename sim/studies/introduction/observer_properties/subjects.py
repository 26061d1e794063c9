"""The estimators whose declared properties are measured, and the runs that this is done by.

Every run is without noise. Starts are drawn over the whole space of the system, the same for every estimator of that
system.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from mathnavi.models.textbook.library import SYSTEMS
from mathnavi.sim.interfaces.fields import with_fields
from mathnavi.sim.interfaces.observer_properties import ObserverProperties
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.studies.introduction.observer_properties.measures import MEASURE, OnTruth
from mathnavi.sim.sweep.trial import Trial, trial

SLOW = ("camera-and-flags",)  # the robot has to come near the flags
NEAR, FAR = 0.1, 3.0  # of the error that a textbook system starts with by itself
SILENT = {"noise.range_relative": 0.0, "noise.odometry_noise": (0.0, 0.0), "noise.odometry_bias": 0.0}
RANGE_INPUTS = ("figure-eight", "circle", "random", "straight", "still")
SIGNALS = {"zero": (0.0, 0.0), "constant": (0.3, 0.0), "sine": (0.0, 0.5), "fast sine": (0.0, 2.0)}  # constant, sine
SPAN = {  # (low, high) of the starts of each state of a textbook system
    "example-2-2": ((-6.0, -4.0), (-2.0, 0.0), (-1.0, 1.0)),  # from where no input here makes it escape
    "krener-isidori": ((-2.0, 2.0), (-2.0, 2.0)),
    "kazantzis-kravaris": ((-0.8, 0.8), (-0.5, 0.5)),
    "camera-and-flags": ((2.2, 2.8), (-4.2, -3.8), (1.5, 1.64)),  # from where the flags stay in sight
}
SPEED = 10.0  # [rad/s, 1/s] of which ``NEAR`` and ``FAR`` are shares where a start is known to be at rest
BRIEF = 0.3  # of the time of a textbook system, for those that find a velocity within tenths of a second
TORQUES = {  # [N m] constant and sine about each axis of the body, whose inertia is .05 kg m^2
    "none": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "constant": ((0.05, -0.03, 0.04), (0.0, 0.0, 0.0)),
    "sine": ((0.0, 0.0, 0.0), (0.3, 0.2, 0.25)),
    "strong sine": ((0.0, 0.0, 0.0), (3.0, 2.0, 2.5)),
}


class Arena(Protocol):
    """The scenario that an estimator is run in, and how hard a start in it is."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs that it is run with."""
        ...

    @property
    def tells_certainty(self) -> bool:
        """Tell whether a start that is given exactly also counts as certain, so that starts on the truth need more."""
        ...

    def fields(self, seed: int, seconds: float, share: float, signal: str) -> tuple[str, dict[str, Any]]:
        """Scenario and fields of a start that is known with a share of the usual error; "": its own input."""
        ...


@dataclass(frozen=True)
class Textbook:
    """A system of the textbook, whose start is known with an error."""

    system: str
    tells_certainty = False

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(SIGNALS) if SYSTEMS[self.system].inputs else ("none",)

    def fields(self, seed: int, seconds: float, share: float, signal: str) -> tuple[str, dict[str, Any]]:
        """Scenario and fields of a start that is known with a share of the usual error; "": its own input."""
        rng, system = np.random.default_rng(seed), SYSTEMS[self.system]
        start = [float(rng.uniform(*span)) for span in SPAN[self.system]]
        size = np.abs(system.start_error)
        error = share * size * rng.choice([-1.0, 1.0], len(start)) * rng.uniform(0.5, 1.0, len(start))
        fields: dict[str, Any] = {"system": self.system, "start": tuple(start), "start_error": tuple(error.tolist())}
        if signal in SIGNALS:
            constant, sine = SIGNALS[signal]
            fields["planner.constant"] = (constant,) * len(system.inputs)
            fields["planner.amplitude"] = (sine,) * len(system.inputs)
        return "textbook-observer", {**fields, "duration": seconds * (2.0 if self.system in SLOW else 1.0)}


@dataclass(frozen=True)
class Wall:
    """The robot within a wall: near is .05 m and 3 degrees off, far is anywhere."""

    inputs = RANGE_INPUTS
    tells_certainty = True

    def fields(self, seed: int, seconds: float, share: float, signal: str) -> tuple[str, dict[str, Any]]:
        """Scenario and fields of a start that is known with a share of the usual error; "": its own input."""
        known = {"start_known": True, "start_error": (0.05, 0.05, 3.0)} if share <= NEAR else {}
        fields = {**SILENT, **known, "duration": 2.0 * seconds, "planner.mode": signal or RANGE_INPUTS[0]}
        return "range-localisation", fields


@dataclass(frozen=True)
class Space:
    """A body on a curved space, of whose start only the position is known: the error is the velocity."""

    space: str = "body"
    tells_certainty = False

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(TORQUES) if self.space == "body" else ("none",)

    def fields(self, seed: int, seconds: float, share: float, signal: str) -> tuple[str, dict[str, Any]]:
        """Scenario and fields of a start that is known with a share of the usual error; "": its own input."""
        fields: dict[str, Any] = {
            "space": self.space, "speed": share * SPEED, "duration": BRIEF * seconds, "settled": 0.0,
            "reading.noise": 0.0, "speed_max": 2.0 * FAR * SPEED,
        }  # fmt: skip
        if self.space == "body":
            fields["planner.constant"], fields["planner.amplitude"] = TORQUES[signal or "sine"]
        else:
            fields["force"] = "linear"
        return "sphere-observer", fields


@dataclass(frozen=True)
class Subject:
    """An estimator with a configuration, and where it is run."""

    name: str
    estimator: str
    arena: Arena = field(default_factory=Wall)
    configuration: Mapping[str, Any] = field(default_factory=dict, hash=False)  # fields of the estimator

    @property
    def declared(self) -> ObserverProperties:
        """Table 2.1, as it says."""
        plugin = load("estimators", self.estimator)
        properties: ObserverProperties = plugin.properties(with_fields(plugin.Config(), self.configuration))
        return properties

    def near(self, seed: int, seconds: float) -> Trial:
        """Trial from a start that is known with a small error."""
        return self._trial(seed, seconds, NEAR)

    def far(self, seed: int, seconds: float) -> Trial:
        """Trial from anywhere: a start that is known with a large error, or not at all."""
        return self._trial(seed, seconds, FAR)

    def true(self, seed: int, seconds: float) -> Trial:
        """Trial from a start that is known as it is, where that does not also count as certain."""
        return self._trial(seed, seconds, 0.0)

    def on_truth(self, seed: int) -> OnTruth:
        """The same, of the robot."""
        return OnTruth(self.estimator, dict(self.configuration), seed)

    def under(self, name: str, seed: int, seconds: float) -> Trial:
        """Trial as near, under another input."""
        return self._trial(seed, seconds, NEAR, name)

    def _trial(self, seed: int, seconds: float, share: float, signal: str = "") -> Trial:
        own = {f"estimator.{name}": value for name, value in self.configuration.items()}
        scenario, fields = self.arena.fields(seed, seconds, share, signal)
        return trial(scenario, seed, estimator=self.estimator, fields={**fields, **own}, measure=MEASURE)


PRINTED = Subject("(C.5) as printed", "range_observer", configuration={"feedforward": "none"})
SUBJECTS = (
    PRINTED,
    Subject("Example 2.2", "example_2_2", Textbook("example-2-2")),
    Subject("Example 2.2, β < 0", "example_2_2", Textbook("example-2-2"), {"beta": -0.2}),
    Subject("output injection (2.3)", "output_injection", Textbook("krener-isidori")),
    Subject("Kazantzis-Kravaris, z", "kazantzis_kravaris", Textbook("kazantzis-kravaris")),
    Subject("(2.4) corrected", "kazantzis_kravaris", Textbook("kazantzis-kravaris"), {"form": "corrected"}),
    Subject("(2.4) as printed", "kazantzis_kravaris", Textbook("kazantzis-kravaris"), {"form": "printed"}),
    Subject("EKF, van der Pol", "textbook_ekf", Textbook("krener-isidori")),
    Subject("EKF, camera and flags", "textbook_ekf", Textbook("camera-and-flags")),
    Subject("(C.5), feed-forward", "range_observer"),
    Subject("feasible-set bank", "feasible_set_bank"),
    Subject("range EKF", "range_ekf"),
    Subject("range UKF", "range_ukf"),
    Subject("range particles", "range_particle"),
    Subject("range IEKF", "range_iekf"),
    Subject("certified bank", "range_certified"),
    Subject("moving horizon, ranges", "moving_horizon"),
    Subject("(D.6), attitude", "riemannian_observer", Space()),
    Subject("(D.6), hyperbolic plane", "riemannian_observer", Space("hyperbolic-plane")),
    Subject("(D.6) with printed gains", "riemannian_observer", Space(), {"gains": "printed"}),
    Subject("high gain", "high_gain", Space()),
    Subject("Lagrangian EKF", "lagrangian_ekf", Space()),
    Subject("Lagrangian UKF", "lagrangian_ukf", Space()),
    Subject("filtered differences", "filtered_differences", Space()),
)
