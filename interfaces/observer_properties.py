"""Declared properties of an observer, in the terms of Table 2.1: each property with its space.

A claim is verified by measurement, so an estimator that converges in practice from many starts but not from all
is ``LOCAL``, with the rest in its note.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Domain(Enum):
    """Domain of attraction, or of the operation of the observer or of the system."""

    GLOBAL = "global"
    SEMI_GLOBAL = "semi-global"  # on any compact set, with the parameters chosen for it
    LOCAL = "local"
    NONE = "none"  # of attraction: it does not converge from any start


class Rate(Enum):
    """Decay of the error without noise (Definition 2.2)."""

    ASYMPTOTIC = "asymptotic"
    EXPONENTIAL = "exponential"
    FINITE_TIME = "finite-time"
    NONE = "none"  # it does not decay to zero: Property 2.2 fails


class InputDependence(Enum):
    """Inputs of the system for which the observer converges."""

    UNIFORM = "uniform"  # all
    SEMI_UNIFORM = "semi-uniform"  # all of any compact set, with the parameters chosen for it
    NON_UNIFORM = "non-uniform"  # not all: some excite too little


@dataclass(frozen=True)
class ObserverProperties:
    """Properties of one estimator, as in Table 2.1."""

    domain_of_attraction: Domain  # in Z
    rate: Rate  # in Z or X
    input_dependence: InputDependence  # in U
    observer_domain: Domain  # in Z: how far its state may be from the truth's while it runs
    system_domain: Domain  # in X: where the system may run
    stays_on_truth: bool = True  # Property 2.1: started on the truth, without noise, it stays there
    note: str = ""
