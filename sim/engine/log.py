"""Recording of a run while it flies: arrays over time, events, and the solve times.

Arrays have dotted names: ``t``, ``truth.x`` (n, nx), ``truth.activation`` (n, na; if actuators have states of their
own), ``truth.estimands`` (n, m; the true values of what there is to estimate, if the scenario declares them),
``measurement.NAME`` (n, m; the newest, NaN where none), ``estimate.t``, ``estimate.x``, ``estimate.deviation`` (k, nx;
the roots of its variances, NaN where it has no covariance, if any has one), ``command.u`` (n, nu; held over
[t_i, t_i+1]), ``plan.*`` flat with ``plan.offsets``, and ``cramer_rao.deviation`` (n, m), bounds on the standard
deviations of errors, if the metrics define any. A single vehicle is logged without a prefix, a fleet's arrays as
``VEHICLE.truth.x``. Wall-clock figures are not in the arrays, so that the same seed gives the same log bit for bit; the
times of answers, and delays made of them, are kept beside.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mathnavi.interfaces.protocols import Plant, PlantWithActivations, PlantWithSignalNames
from mathnavi.interfaces.signal_names import SignalNames, name_and_unit
from mathnavi.interfaces.signals import Array, Estimate, Event, Measurement, Plan, Status, status_text
from mathnavi.sim.engine.answer_times import AnswerTimes

DEVIATION = "estimate.deviation"  # name of the standard deviations of an estimate
LEFT_OUT = "left_out"  # name of what says, in an estimate, which channels it leaves out


@dataclass
class AgentRecorder:
    """Log of one agent while it runs."""

    name: str
    events: list[Event]
    commands: Array  # (n, nu)
    readings: dict[str, Array]  # (n, m) by sensor
    estimates: list[Estimate] = field(default_factory=list)
    plans: list[tuple[float, Plan]] = field(default_factory=list)  # (adopted at, plan)
    requests: int = 0
    answers: int = 0  # those that are answered by the planner's own plans
    solve_ms: list[float] = field(default_factory=list)
    answer_times: dict[str, AnswerTimes] = field(default_factory=dict)  # by component
    delays: list[float] = field(default_factory=list)  # [s] of each request, if plans take simulated time
    figures: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # names in an estimate's further figures

    def event(self, t: float, kind: str, message: str = "") -> None:
        self.events.append(Event(t, self.name, kind, message))

    def measurements(self, k: int, readings: Sequence[Measurement]) -> None:
        """Record the readings of the k-th control step."""
        for reading in readings:
            self.readings[reading.name][k] = reading.value

    def estimate(self, estimate: Estimate) -> None:
        """Record an estimate, and events if its status or what it leaves out changes."""
        before = self.estimates[-1].status if self.estimates else Status.OK
        if before is not estimate.status:
            text = f"{estimate.status.name.lower()}: {status_text(estimate)}"
            self.event(estimate.t, "estimator-status", text)
        left_out = self._left_out(estimate)
        was = self._left_out(self.estimates[-1]) if self.estimates else frozenset()
        for text, names in (("leaves out {}", left_out - was), ("uses {} again", was - left_out)):
            if names:
                self.event(estimate.t, "sensor-left-out", text.format(", ".join(sorted(names))))
        self.estimates.append(estimate)

    def _left_out(self, estimate: Estimate) -> frozenset[str]:
        """Names of the channels that an estimate leaves out."""
        out = estimate.extra.get(LEFT_OUT)
        if out is None or not out.any():
            return frozenset()
        names = self.figures.get(LEFT_OUT, ())
        if len(names) != len(out):
            return frozenset(f"channel {i}" for i in np.flatnonzero(out).tolist())
        return frozenset(name_and_unit(names[i])[0] for i in np.flatnonzero(out).tolist())

    def asked(self, plan: Plan) -> None:
        """Count a request for a plan, and its answer."""
        self.requests += 1
        self.answers += plan.ok and not plan.by_fallback
        if math.isfinite(plan.solve_ms):
            self.solve_ms.append(plan.solve_ms)

    def adopted(self, t: float, plan: Plan) -> None:
        """Record the adoption of a plan at t [s]."""
        self.plans.append((t, plan))

    def command(self, k: int, command: Array) -> None:
        """Record the command (nu,) of the k-th control step."""
        self.commands[k] = command

    def arrays(self, length: int) -> dict[str, Array]:
        """Return the agent's arrays, truncated to ``length`` ticks."""
        out = {"command.u": self.commands[:length]}
        out |= {f"measurement.{name}": values[:length] for name, values in self.readings.items()}
        if self.estimates:
            out["estimate.t"] = np.array([estimate.t for estimate in self.estimates])
            out["estimate.x"] = np.array([estimate.x for estimate in self.estimates])
            names = set.intersection(*(set(estimate.extra) for estimate in self.estimates))
            further = {f"estimate.{name}": [estimate.extra[name] for estimate in self.estimates] for name in names}
            if DEVIATION not in further and any(estimate.covariance is not None for estimate in self.estimates):
                further[DEVIATION] = [_deviations(estimate) for estimate in self.estimates]
            out |= {name: np.array(further[name]) for name in sorted(further)}
        return out | self._plan_arrays()

    def _plan_arrays(self) -> dict[str, Array]:
        plans = [plan for _, plan in self.plans]
        if not plans:
            return {}
        # One row per breakpoint; the last of each plan holds no input.
        padded = [np.vstack([plan.u, np.full((1, plan.u.shape[1]), np.nan)]) for plan in plans]
        return {
            "plan.offsets": np.concatenate([[0], np.cumsum([len(plan.t) for plan in plans])]),
            "plan.t": np.concatenate([plan.t for plan in plans]),
            "plan.x": np.vstack([plan.x for plan in plans]),
            "plan.u": np.vstack(padded),
            "plan.phase": np.concatenate([np.append(plan.phase, -1) for plan in plans]),
            "plan.adopted": np.array([t for t, _ in self.plans]),
            "plan.cost": np.array([plan.cost for plan in plans]),
        }


def _deviations(estimate: Estimate) -> Array:
    """Standard deviations (nx,) of an estimate by its covariance; NaN without one."""
    if estimate.covariance is None:
        return np.full(len(estimate.x), np.nan)
    deviations: Array = np.sqrt(np.maximum(estimate.covariance.diagonal(), 0.0))
    return deviations


def names_of(plant: Plant, name: str) -> SignalNames:
    """Return the names of a vehicle's signals that its plant knows, those of its states at least."""
    if isinstance(plant, PlantWithSignalNames):
        return plant.signal_names(name)
    return SignalNames(plant.state_names(name))


@dataclass
class Recording:
    """Log of a run, in memory; ``mathnavi.sim.records.run_folder`` writes it."""

    t: Array  # (n,) [s]
    truths: dict[str, Array]  # (n, nx) by vehicle
    agents: dict[str, AgentRecorder]
    events: list[Event]
    state_names: dict[str, tuple[str, ...]]
    length: int = 0
    cramer_rao: dict[str, Array] = field(default_factory=dict)  # (n, m) deviations by vehicle, if there is a bound
    activations: dict[str, Array] = field(default_factory=dict)  # (n, na) by vehicle whose actuators have states
    activation_names: dict[str, tuple[str, ...]] = field(default_factory=dict)
    signals: dict[str, SignalNames] = field(default_factory=dict)  # by vehicle, as far as they are known
    estimands: dict[str, Array] = field(default_factory=dict)  # (n, m) by vehicle: true values of ``signals.estimands``

    @staticmethod
    def begin(plant: Plant, input_sizes: Mapping[str, int], length: int) -> Recording:
        """Begin an empty log with room for ``length`` ticks."""
        events: list[Event] = []
        agents = {
            name: AgentRecorder(
                name,
                events,
                np.zeros((length, size)),
                {sensor: np.full((length, m), np.nan) for sensor, m in plant.sensor_sizes(name).items()},
            )
            for name, size in input_sizes.items()
        }
        truths = {name: np.zeros((length, plant.state(name).size)) for name in plant.names}
        names = {name: plant.state_names(name) for name in plant.names}
        recording = Recording(np.zeros(length), truths, agents, events, names)
        recording.signals = {name: names_of(plant, name) for name in plant.names}
        if isinstance(plant, PlantWithActivations):
            recording.activation_names = {name: own for name in plant.names if (own := plant.activation_names(name))}
        for name, own in recording.activation_names.items():
            recording.activations[name] = np.zeros((length, len(own)))
        return recording

    def truth(self, k: int, t: float, truths: Mapping[str, Array], activations: Mapping[str, Array]) -> None:
        """Record the k-th sample: t [s], and by vehicle the true states (nx,) and the activations (na,) there are."""
        self.t[k] = t
        for name, x in truths.items():
            self.truths[name][k] = x
        for name, activation in activations.items():
            self.activations[name][k] = activation
        self.length = k + 1

    def end(self) -> Recording:
        """Truncate the log to the samples that were flown, and return it."""
        self.t = self.t[: self.length]
        self.truths = {name: x[: self.length] for name, x in self.truths.items()}
        self.activations = {name: each[: self.length] for name, each in self.activations.items()}
        return self

    def arrays(self) -> dict[str, Array]:
        """Return all arrays by their names in log.npz."""
        out = {"t": self.t}
        for name, truth in self.truths.items():
            prefix = "" if len(self.truths) == 1 else f"{name}."
            out[f"{prefix}truth.x"] = truth
            if name in self.activations:
                out[f"{prefix}truth.activation"] = self.activations[name]
            if name in self.estimands:
                out[f"{prefix}truth.estimands"] = self.estimands[name]
            if name in self.agents:
                out |= {f"{prefix}{key}": value for key, value in self.agents[name].arrays(self.length).items()}
            if name in self.cramer_rao:
                out[f"{prefix}cramer_rao.deviation"] = self.cramer_rao[name]
        return out
