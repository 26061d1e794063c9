"""Names of the fields of dataclasses on the command line."""

from __future__ import annotations


def joined(prefix: str, field: str) -> str:
    """Return the dotted name of a field below a prefix: "noise.rate"; the "_" that ends a reserved word is dropped."""
    return f"{prefix}.{field.rstrip('_')}".strip(".")


def flag_of(name: str) -> str:
    """Return the flag of a dotted name: --planner.grid-nodes for planner.grid_nodes."""
    return f"--{name.replace('_', '-')}"


def negation(flag: str) -> str:
    """Return the flag that sets a truth value to false: --planner.no-warm for --planner.warm."""
    above, dot, name = flag.removeprefix("--").rpartition(".")
    return f"--{above}{dot}no-{name}"
