"""Statement of all phases over one normalised time, to which phases and their clocks are added one by one.

The formulas are those of ``phases``.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.clocks import clock_name, rate_name
from mathnavi.controllers.ocp.comparisons import Row
from mathnavi.controllers.ocp.guesses import Values
from mathnavi.controllers.ocp.instants import check_instant
from mathnavi.controllers.ocp.lowering import Guesses, guesses_of
from mathnavi.controllers.ocp.scaling import shared_by_phases
from mathnavi.controllers.ocp.statement import Instant, Parameter, Statement, Variable
from mathnavi.controllers.ocp.substitutions import guessed, since_start
from mathnavi.interfaces.errors import ProblemError


def add_clock(stacked: Statement, name: str) -> tuple[ca.SX, ca.SX]:
    """Add the clock of a phase; returns its time, a fraction of the phase's duration, and its rate."""
    time, rate = ca.SX.sym(clock_name(name)), ca.SX.sym(rate_name(name))
    free = -math.inf, math.inf, 1.0
    stacked.states.append(Variable(clock_name(name), time, *free, Values(np.array([0.0, 1.0]))))
    stacked.controls.append(Variable(rate_name(name), rate, *free, Values(np.array([1.0]))))
    stacked.rates[clock_name(name)] = rate
    stacked.initial.append(Row(time, 0.0, 0.0, f"start of {clock_name(name)}"))
    return time, rate


def phase_guesses(problem: str, phases: Mapping[str, Statement]) -> dict[str, Guesses]:
    """Guesses and scales of each phase, by name; states of the same name have the same automatic scale.

    Raises ProblemError for a phase that is not complete, with the name of the problem, and as ``guesses_of`` does.
    """
    for name, phase in phases.items():
        if phase.duration is None:
            raise ProblemError(f"{problem}: phase {name} has no duration; allowed: duration() or free_duration()")
        if missing := [v.name for v in phase.states if v.name not in phase.rates]:
            raise ProblemError(f"{problem}: phase {name}: no dynamics for {', '.join(missing)}; allowed: one for each")
    found = {name: guesses_of(guessed(since_start(phase))) for name, phase in phases.items()}
    shared = shared_by_phases({name: (phases[name].states, own.state_scales) for name, own in found.items()})
    return {name: dataclasses.replace(own, state_scales=shared[name]) for name, own in found.items()}


def add_phase(
    stacked: Statement,
    name: str,
    phase: Statement,
    guess: Guesses,
    elapsed: ca.SX,
    clock: tuple[ca.SX, ca.SX],
    shared: list[Parameter],
) -> ca.SX:
    """Add a phase that begins at t = ``elapsed`` [s], with its guess, time and rate on τ; returns when it ends."""
    duration = phase.duration
    assert duration is not None
    T = phase.final_time if duration.free else ca.SX(duration.guess)
    begin = elapsed if phase.start_time.is_zero() else phase.start_time
    time, rate = clock
    now = begin + time * T

    def at(made: ca.SX) -> ca.SX:
        own = ca.vertcat(phase.t, phase.elapsed, phase.final_time)
        return ca.substitute(made, own, ca.vertcat(now, time * T, T))

    def renamed(rows_of: list[Row]) -> list[Row]:
        return [dataclasses.replace(row, expression=at(row.expression), name=f"{name}: {row.name}") for row in rows_of]

    columns = zip((*guess.states.T, *guess.controls.T), (*guess.state_scale, *guess.control_scale), strict=True)
    for k, (variable, (values, scale)) in enumerate(zip((*phase.states, *phase.controls), columns, strict=True)):
        among = stacked.states if k < len(phase.states) else stacked.controls
        own = Values(values, guess.times)
        among.append(dataclasses.replace(variable, name=f"{name}.{variable.name}", scale=float(scale), guess=own))
    stacked.rates |= {f"{name}.{state}": rate * T * at(own) for state, own in phase.rates.items()}
    if duration.free:
        constant = Values(np.array([duration.guess]))
        stacked.states.append(Variable(f"{name}.duration", T, duration.lower, duration.upper, duration.guess, constant))
        stacked.rates[f"{name}.duration"] = ca.SX(0)
    stacked.parameters += [
        dataclasses.replace(each, name=f"{name}.{each.name}") for each in phase.parameters if each not in shared
    ]
    stacked.running += rate * T * at(phase.running)
    stacked.terminal += at(phase.terminal)
    stacked.path += renamed(phase.path)
    stacked.initial += renamed(phase.initial)
    stacked.final += renamed(phase.final)
    stacked.instants += _instants(stacked.name, name, phase, begin)
    return begin + T


def _instants(problem: str, name: str, phase: Statement, begin: ca.SX) -> list[Instant]:
    """Costs and constraints of a phase at given times, over τ; ProblemError for a free duration and times beyond."""
    assert phase.duration is not None
    T, symbols = phase.duration.guess, ca.vertcat(phase.t, phase.elapsed, phase.final_time)
    found = []
    for each in phase.instants:
        check_instant(f"{problem}: phase {name}", each.time, phase.duration)
        now = ca.vertcat(begin + each.time, each.time, phase.final_time if phase.duration.free else T)
        rows_of = tuple(
            dataclasses.replace(row, expression=ca.substitute(row.expression, symbols, now), name=f"{name}: {row.name}")
            for row in each.rows
        )
        found.append(Instant(min(each.time / T, 1.0), ca.substitute(each.cost, symbols, now), rows_of))
    return found
