"""What both planners' configurations check of the fields they share."""

from __future__ import annotations

from typing import Any

from mathnavi.sim.interfaces.checks import check_positive


def check_fields(config: Any, least_nodes: int, positive: tuple[str, ...]) -> None:
    """ValueError that names the field, its value and what is allowed.

    The fields ``positive`` may also be None; ``nodes``, ``grid_nodes`` and ``grid_layers`` are checked always. Their
    upper limits are what still fits a machine.
    """
    check_positive(config, *positive)
    for name, least, most in (("nodes", least_nodes, 121), ("grid_nodes", 3, 513), ("grid_layers", 2, 65)):
        if not least <= getattr(config, name) <= most:
            raise ValueError(f"{name} = {getattr(config, name)}; allowed: {least} to {most}")
