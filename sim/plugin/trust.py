"""Code that a folder may name: a run's config.json is data, and data of a stranger runs nothing that he chose.

What is installed as an entry point is loaded, whether it is named by its name or by its place, "package.module:Class".
Everything else that a folder names is loaded only within ``trusting()``, which ``--trust`` asks for.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from mathnavi.sim.interfaces.errors import UntrustedError
from mathnavi.sim.plugin.groups import GROUPS, installed

_PLACE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_][\w.]*")
_trusted: ContextVar[bool] = ContextVar("trusted", default=False)
_recorded: ContextVar[Mapping[str, str]] = ContextVar("recorded", default={})  # noqa: B039 - never changed


@contextmanager
def trusting(trust: bool = True) -> Iterator[None]:
    """Folders that are read in here may name any code, if ``trust``; else only what is installed."""
    token = _trusted.set(trust)
    try:
        yield
    finally:
        _trusted.reset(token)


def is_trusted() -> bool:
    """True within ``trusting()``."""
    return _trusted.get()


def recorded_places(fields: Any, where: str) -> dict[str, str]:
    """Every text "package.module:Class" in the recorded fields of a scenario or a plug-in, with where it was read.

    Some of them name code, which only whoever loads them knows: ``within_record`` refuses these. There are none in a
    folder that is trusted.
    """
    return {} if is_trusted() else {text: where for text in _texts(fields) if _PLACE.fullmatch(text)}


@contextmanager
def within_record(places: Mapping[str, str]) -> Iterator[None]:
    """In here, ``check_loaded`` refuses the places that a folder names."""
    token = _recorded.set(places)
    try:
        yield
    finally:
        _recorded.reset(token)


def check_loaded(place: str) -> None:
    """UntrustedError for a place that a folder names, and that is about to be loaded, unless it is installed."""
    if place in _recorded.get():
        check_place(place, _recorded.get()[place])


def check_place(place: str, where: str) -> None:
    """UntrustedError unless a place that a folder names is that of an installed plug-in, or the folder is trusted."""
    if not is_trusted() and not _is_installed(place):
        raise UntrustedError(
            f"{where} names code that is not installed: {place!r}; allowed: installed plug-ins, or --trust, with which "
            "the code that the folder names is imported and runs as you"
        )


def uninstalled(places: Iterable[str]) -> tuple[str, ...]:
    """The plug-ins among names and places "package.module:Class" that are not installed, each once.

    A folder that records one of them is run again with ``--trust`` only.
    """
    return tuple(place for place in dict.fromkeys(places) if _PLACE.fullmatch(place) and not _is_installed(place))


def _is_installed(place: str) -> bool:
    return any(point.value == place for kind in GROUPS for point in installed(kind))


def _texts(value: Any) -> Iterator[str]:
    """Every text within plain data."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from _texts(item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _texts(item)
