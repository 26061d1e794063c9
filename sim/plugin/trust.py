"""Trust in code that a folder names: a run's config.json is data, and data from others must not run arbitrary code.

A plug-in that is installed as an entry point is loaded, by its name or by its place, "package.module:Class".
All other code that a folder names is loaded only within ``trusting()``, which ``--trust`` requests.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from mathnavi.interfaces.errors import UntrustedError
from mathnavi.sim.plugin.groups import GROUPS, installed

_PLACE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_][\w.]*")
_trusted: ContextVar[bool] = ContextVar("trusted", default=False)
_recorded: ContextVar[Mapping[str, str]] = ContextVar("recorded", default={})  # noqa: B039 - never changed


@contextmanager
def trusting(trust: bool = True) -> Iterator[None]:
    """Allow folders that are read within the block to name any code if ``trust``; else only installed plug-ins."""
    token = _trusted.set(trust)
    try:
        yield
    finally:
        _trusted.reset(token)


def is_trusted() -> bool:
    """Return True within ``trusting()``."""
    return _trusted.get()


def recorded_places(fields: Any, where: str) -> dict[str, str]:
    """Return every text "package.module:Class" in the recorded fields of a scenario or a plug-in, with its origin.

    Some of them name code, which only the code that loads them knows: ``within_record`` refuses these. For a trusted
    folder the result is empty.
    """
    return {} if is_trusted() else {text: where for text in _texts(fields) if _PLACE.fullmatch(text)}


@contextmanager
def within_record(places: Mapping[str, str]) -> Iterator[None]:
    """Let ``check_loaded`` refuse, within the block, the places that a folder names."""
    token = _recorded.set(places)
    try:
        yield
    finally:
        _recorded.reset(token)


def check_loaded(place: str) -> None:
    """Raise UntrustedError for a place that a folder names, and that is about to be loaded, unless it is installed."""
    if place in _recorded.get():
        check_place(place, _recorded.get()[place])


def check_place(place: str, where: str) -> None:
    """Raise UntrustedError unless a place that a folder names is that of an installed plug-in, or the folder is
    trusted.
    """
    if not is_trusted() and not _is_installed(place):
        raise UntrustedError(
            f"{where} names code that is not installed: {place!r}; allowed: installed plug-ins, or --trust, with which "
            "the code that the folder names is imported and runs as you"
        )


def uninstalled(places: Iterable[str]) -> tuple[str, ...]:
    """Return the plug-ins among names and places "package.module:Class" that are not installed, each once.

    A folder that records one of them is run again only with ``--trust``.
    """
    return tuple(place for place in dict.fromkeys(places) if _PLACE.fullmatch(place) and not _is_installed(place))


def _is_installed(place: str) -> bool:
    return any(point.value == place for kind in GROUPS for point in installed(kind))


def _texts(value: Any) -> Iterator[str]:
    """Return every text within plain data."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from _texts(item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _texts(item)
