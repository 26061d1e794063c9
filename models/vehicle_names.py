"""Names of vehicles, which precede those of their parts in a MuJoCo model: ``NAME/body``."""

from __future__ import annotations

from collections.abc import Sequence

from mathnavi.interfaces.errors import FieldError


def check_vehicle_name(name: str) -> None:
    """Raise FieldError for a name that is empty or contains "/"."""
    if not name or "/" in name:
        raise FieldError(
            f"vehicle name = {name!r}; allowed: any but an empty one, without '/', which ends it in MuJoCo"
        )


def check_vehicle_names(names: Sequence[str]) -> None:
    """Raise FieldError for no names, a name that is there twice, or one that ``check_vehicle_name`` refuses."""
    if not names or len(set(names)) != len(names):
        raise FieldError(f"vehicle names = {list(names)!r}; allowed: at least one, each of them once")
    for name in names:
        check_vehicle_name(name)
