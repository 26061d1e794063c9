"""The part of the study of integrity by the outputs of a textbook system.

Example 2.2 for its own observer, and van der Pol's oscillator, which never comes to rest, for the others. The state
that is measured and the others are judged each by themselves; there is no protection level.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.integrity.repeats import STUCK
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.textbook.extended_kalman import TextbookEkf
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.textbook.library import EXAMPLE_2_2, KRENER_ISIDORI
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.textbook.system import System
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.ranging.integrity_detection import by_windows, from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

ESTIMATORS = ("example_2_2", "output_injection", "kazantzis_kravaris", "textbook_ekf")
PERIOD = 0.01  # [s] of readings, inputs and estimates
DURATION, ONSET, END = 60.0, 10.0, 20.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 5.0)
NOISE, UNSURE = 0.02, 0.2  # standard deviations of a reading, and of each state at the start
LATE, SILENT, OFF = 0.1, 2.0, 0.5  # [s], [s], [unit of the output]
STANDS, NOISY, UNDRIVEN, MOVED = "output stuck", "noise times 3", "input off", "moved by 1"
SETTING = (
    f"The output of a textbook system, with noise of {NOISE:g}, is read {1.0 / PERIOD:g} times a second for "
    f"{DURATION:g} s, the fault from {ONSET:g} to {END:g} s; the state that is measured and the others are judged, "
    "without a protection level."
)


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of n updates, whose readings have no fault."""

    truth: Array  # (n, d)
    outputs: Array  # (n,) NaN where nothing is read
    noise: Array  # (n,) in them
    inputs: Array  # (n, 1) asked for since the update before


Fault = Callable[[Motion, slice], None]
"""change of the readings of a motion, in place, in the updates of a slice"""


def _none(motion: Motion, during: slice) -> None:
    pass


def _stuck(motion: Motion, during: slice) -> None:
    motion.outputs[during] = motion.outputs[during.start]


def _off(motion: Motion, during: slice) -> None:
    motion.outputs[during] += OFF


def _drift(motion: Motion, during: slice) -> None:
    motion.outputs[during] += 0.1 * PERIOD * np.arange(during.stop - during.start)


def _scaled(motion: Motion, during: slice) -> None:
    motion.outputs[during] = 1.1 * (motion.outputs[during] - motion.noise[during]) + motion.noise[during]


def _noisy(motion: Motion, during: slice) -> None:
    motion.outputs[during] += 2.0 * motion.noise[during]


def _doubled(motion: Motion, during: slice) -> None:
    """Every second reading is the one before, with a later time stamp."""
    motion.outputs[during][1::2] = motion.outputs[during][::2]


def _late(motion: Motion, during: slice) -> None:
    """Readings of ``LATE`` ago with the stamp of now."""
    ago = round(LATE / PERIOD)
    motion.outputs[during] = motion.outputs[during.start - ago : during.stop - ago].copy()


def _silent(motion: Motion, during: slice) -> None:
    motion.outputs[during.start : during.start + round(SILENT / PERIOD)] = np.nan


FAULTS: dict[str, Fault] = {
    "none": _none,
    "output 0.5 off": _off,
    STANDS: _stuck,
    "output drifts by 0.1/s": _drift,
    "output times 1.1": _scaled,
    NOISY: _noisy,
    "every reading twice": _doubled,
    "readings 0.1 s late": _late,
    "silent for 2 s": _silent,
    UNDRIVEN: _none,  # the system itself, not its readings
    MOVED: _none,  # likewise
}


def observed(estimator: str) -> System:
    """The system whose state an estimator observes."""
    return EXAMPLE_2_2 if estimator == "example_2_2" else KRENER_ISIDORI


def measured(system: System) -> int:
    """Index of the state that is measured."""
    return 1 if system is EXAMPLE_2_2 else 0


def moved(rng: np.random.Generator, system: System, fault: str) -> Motion:
    """A motion whose readings have no fault: it is ``fault`` that takes its input away, or that moves it."""
    n, m = round(DURATION / PERIOD), measured(system)
    x = np.array(system.start) + UNSURE * rng.standard_normal(len(system.start))
    amplitude, phase = rng.uniform(0.5, 1.0) * system.amplitude[0], 0.0
    truth, inputs, u = np.empty((n, len(x))), np.empty((n, 1)), np.zeros(1)
    for k in range(n):
        t = PERIOD * k
        if k == round(ONSET / PERIOD) and fault == MOVED:
            x[m] -= 1.0
        truth[k], inputs[k] = x, u
        u = np.array([amplitude * np.sin(t + phase)])
        x = system.flow(x, 0.0 * u if fault == UNDRIVEN and ONSET <= t < END else u, PERIOD)
    noise = NOISE * rng.standard_normal(n)
    exact = np.array([system.output(x, u)[0] for x, u in zip(truth, inputs, strict=True)])
    return Motion(truth, exact + noise, noise, inputs)


def _updates(motion: Motion) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    for k, (y, u) in enumerate(zip(motion.outputs, motion.inputs, strict=True)):
        t = PERIOD * k
        yield t, () if np.isnan(y) else (Measurement("output", t, np.array([y])),), u


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the observer under a fault; the seed determines motion and start."""
    rng = np.random.default_rng(run.seed)
    system, during = observed(run.estimator), slice(round(ONSET / PERIOD), round(END / PERIOD))
    motion = moved(rng, system, run.fault)
    believed = motion.truth[0] + UNSURE * rng.standard_normal(len(system.states))
    faulty = dataclasses.replace(motion, outputs=motion.outputs - motion.noise, noise=np.zeros_like(motion.noise))
    without = copy.deepcopy(faulty)
    FAULTS[run.fault](faulty, during)
    FAULTS[run.fault](motion, during)
    plugin = load("estimators", run.estimator)
    estimator = plugin.build(plugin.Config(), _mission(system, believed, UNSURE))
    estimates = [estimator.update(*update) for update in _updates(motion)]
    m = measured(system)
    others = [k for k in range(len(system.states)) if k != m]
    order = [m, *others]
    estimates = [
        dataclasses.replace(each, x=each.x[order], covariance=each.covariance[np.ix_(order, order)])
        for each in estimates
    ]
    found = findable(system, faulty, without, during, run.fault)
    return judged(estimates, motion.truth[:, order], found, TIMING, blocks=(slice(0, 1), slice(1, len(order))))


def _mission(system: System, start: Array, deviation: float) -> TextbookMission:
    return TextbookMission(
        system, tuple(start.tolist()), (deviation,) * len(start), NOISE, PERIOD
    )  # fmt: skip


def findable(system: System, faulty: Motion, without: Motion, during: slice, fault: str) -> Flags:
    """True (n,) from the update on at which a fault can be found, of a motion without noise, by the innovations of the
    extended Kalman filter; as of the flights.
    """
    e = _innovations(system, faulty)
    chance, rho = np.zeros(len(e)), np.ones(len(e))
    rho[during] = 9.0 if fault == NOISY else 1.0
    read = np.flatnonzero(np.isfinite(e[:, 0]))
    chance[read] = by_windows(e[read], rho[read], InnovationMonitor("outputs", 1, PERIOD).thresholds)
    if fault == STANDS:
        chance[during.start + STUCK :] = 1.0
    return from_onset(chance, during.start)


def _innovations(system: System, motion: Motion) -> Array:
    """Innovations (n, 1), each over its deviation, of a filter that begins at the truth; NaN without a reading."""
    estimator = TextbookEkf(TextbookEkf.Config(), _mission(system, motion.truth[0], UNSURE))
    extras = [estimator.update(*update).extra for update in _updates(motion)]
    return np.array([extra["innovations"] / extra["innovation_std"] for extra in extras])
