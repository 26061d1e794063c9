"""Where a flight may start and lead to: two points with a first plan between them that is certified."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.interfaces.signals import Plan
from mathnavi.sim.scenarios.flight_parts import Point


class Ends(Protocol):
    """Fields of a scenario that say what its start and target are, or how they are drawn."""

    @property
    def start(self) -> Point | None: ...
    @property
    def target(self) -> Point | None: ...
    @property
    def drawn_separation(self) -> tuple[float, float]: ...
    @property
    def arrival_radius(self) -> float: ...


def certified_ends(
    config: Ends,
    terrain: HeightField,
    check: Callable[[str, Point], None],
    draw: Callable[[], Point],
    first_plan: Callable[[Point, Point], Plan],
    draws: int,
) -> tuple[Point, Point, Plan]:
    """Start, target, and the plan from one to the other that proves that the mission can be flown.

    End points that are given must be right, which ``check`` says of each; those that are not are drawn, ``draws`` times
    at most, until they are as far apart as the fields say and the first plan is certified. Raises ValueError where they
    are wrong or none are found.
    """
    for name, given in (("start", config.start), ("target", config.target)):
        if given is not None:
            check(name, given)
    if config.start is not None and config.target is not None:
        if math.dist(config.start, config.target) <= config.arrival_radius:
            raise ValueError(
                f"target = {config.target!r} is where the mission starts; "
                f"allowed: more than arrival_radius = {config.arrival_radius:g} m away from the start"
            )
        plan = first_plan(config.start, config.target)
        if not plan.ok:
            raise ValueError(
                f"start = {config.start!r}, target = {config.target!r}: no initial certificate: {plan.status.value} "
                f"({plan.message}); allowed: a start from which a first plan can be certified"
            )
        return config.start, config.target, plan
    side = max(terrain.width, terrain.depth)
    nearest, farthest = config.drawn_separation
    for _ in range(draws):
        start, target = config.start or draw(), config.target or draw()
        apart = math.dist(start[:2], target[:2])
        if not nearest * side <= apart <= farthest * side or math.dist(start, target) <= config.arrival_radius:
            continue
        plan = first_plan(start, target)
        if plan.ok:
            return start, target, plan
    raise ValueError(
        f"drawn_separation = {config.drawn_separation!r}: none of {draws} missions drawn for start = {config.start!r} "
        f"and target = {config.target!r} has its ends so far apart and an initial certificate; allowed: other shares "
        "of the side, other heights, or both start and target"
    )
