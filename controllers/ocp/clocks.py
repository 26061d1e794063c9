"""Clocks of phases that are stacked on one normalised time τ: each phase may pass it at its own rate.

Phases that switch have their switches at different fractions of their durations, and an arc boundary in τ is one for
all of them. So a phase k that may switch has its own time, θ_k in [0, 1], a state of the stacked problem,

    dθ_k/dτ = w_k,      θ_k(0) = 0,  θ_k(1) = 1,      dx_k/dτ = w_k T_k f_k(x_k, u_k, t_k + θ_k T_k; p),

with a rate w_k, a control, that is 1 or, between two switches of this phase, an unknown constant: the length of an arc
of this phase over that in τ. The grid of a phase is θ_k at the nodes.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mathnavi.controllers.ocp.layout import bounded_states
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.interfaces.signals import Array, Integers


class Clock(NamedTuple):
    """Places of a phase in the stacked problem: of its time and its rate, and what belongs to it."""

    state: int
    rate: int
    held: Integers  # (·,) its controls, path constraints and bounded states, counted one behind the other


def clock_name(phase: str) -> str:
    """Name of the state that is the time of a phase."""
    return f"clock of {phase}"


def rate_name(phase: str) -> str:
    """Name of the control that is the rate of a phase's time."""
    return f"rate of {phase}"


@lru_cache(maxsize=64)
def clocks_of(problem: ProblemFunctions) -> tuple[Clock, ...]:
    """Clocks of a stacked problem; none for any other."""
    names = [*problem.controls, *problem.path_names, *(problem.states[k] for k in bounded_states(problem))]
    return tuple(
        Clock(
            problem.states.index(clock_name(phase)),
            problem.controls.index(rate_name(phase)),
            np.flatnonzero([name.startswith((f"{phase}.", f"{phase}: ")) for name in names]),
        )
        for phase in problem.clocks
    )


def own_arcs(clock: Clock, held: Array | Integers) -> Integers:
    """Index (A,) of the phase's own arc in each arc of all phases: where nothing of it changes, they are one.

    ``held`` (A, nu + nd + nb, ·) is what holds controls, path constraints and bounded states on each arc.
    """
    changes = held[1:, clock.held] != held[:-1, clock.held]
    return np.append(0, np.cumsum(changes.any(axis=tuple(range(1, changes.ndim))))).astype(np.int64)


def without_vanished(clock: Clock, held: Integers, lengths: Array, least: float) -> Integers:
    """Structure (A, nu + nd + nb) in which arcs of the phase below a length hold what a neighbour of theirs does.

    ``held`` has the controls, constraints and bounds that hold on each arc. ``lengths`` (A,) are those of the arcs in
    the phase's own time, of which ``least`` is kept.
    """
    own = own_arcs(clock, held)
    kept = np.flatnonzero(np.bincount(own, lengths) >= least)
    source = kept[np.clip(np.searchsorted(kept, own, side="right") - 1, 0, None)]
    found = held.copy()
    found[:, clock.held] = held[np.searchsorted(own, source)][:, clock.held]
    return found
