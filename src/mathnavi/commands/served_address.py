"""Flags for the address at which a page is served."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

from mathnavi.interfaces.errors import FieldError

HOST, PORT = "127.0.0.1", 8765

Port = Annotated[int, Interval(ge=0, le=65535)]


def check_address(host: str | None, port: int | None, *, web: bool) -> None:
    """Raise FieldError for a host or a port without ``web``."""
    for name, value in (("host", host), ("port", port)):
        if value is not None and not web:
            raise FieldError(f"{name} = {value!r}; allowed: only together with --web")


def address_of(host: str | None, port: int | None) -> tuple[str, int]:
    """Return host and port, with the defaults if not given."""
    return HOST if host is None else host, PORT if port is None else port
