"""The flags that say at which address a page is served."""

from __future__ import annotations

from mathnavi.sim.interfaces.errors import FieldError

HOST, PORT = "127.0.0.1", 8765


def check_address(host: str | None, port: int | None, *, web: bool) -> None:
    """Raise FieldError for an address without ``web``, or a port that is none."""
    for name, value in (("host", host), ("port", port)):
        if value is not None and not web:
            raise FieldError(f"{name} = {value!r}; allowed: only together with --web")
    if port is not None and not 0 <= port <= 65535:
        raise FieldError(f"port = {port}; allowed: a whole number from 0 to 65535")


def address_of(host: str | None, port: int | None) -> tuple[str, int]:
    """Host and port; those that are used where none is given."""
    return HOST if host is None else host, PORT if port is None else port
