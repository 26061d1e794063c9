"""``mathnavi list``: what is installed, and where it comes from.

Names come from the entry points, the rest from the plug-ins' sources: nothing is imported, so that the list is there at
once. A plug-in that cannot be read so is imported. With ``--full`` all are, and estimators say what they claim to be.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import cache
from importlib.metadata import Distribution, EntryPoint
from typing import Any

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from mathnavi.sim.commands.errors import BadInputError
from mathnavi.sim.plugin.sources import GROUPS, UnreadableError, config_fields, definition, installed

ALL, FULL = "all", "--full"
KINDS = tuple(sorted((ALL, *GROUPS)))
USAGE = f"""usage: mathnavi list [{"|".join(KINDS)}] [{FULL}]

The plug-ins that are installed, of one kind or of all. {FULL} imports them, so that one that cannot be used is told,
and adds what estimators claim to be."""
CLAIMED = (
    "claimed (Table 2.1): domain of attraction, rate of convergence, input dependence, domains of operation of the "
    "observer and of the system; whether it stays on the truth (Property 2.1)"
)
WITH_FIELDS = {"controllers": "--planner", "estimators": "--estimator"}


def main(argv: Sequence[str]) -> int:
    if {"-h", "--help"} & set(argv):
        print(USAGE)
        return 0
    kind, full = read_words(argv)
    if full:
        from mathnavi.sim.commands import opengl

        opengl.choose()
    console = Console()
    for each in GROUPS if kind == ALL else (kind,):
        points = installed(each)
        console.print(listing(each, points, full) if points else f"[bold]{each}[/bold]\n  none installed")
        console.print()
        if full and each == "estimators" and points:
            console.print(claimed_properties(points))
            console.print()
    return 0


def read_words(argv: Sequence[str]) -> tuple[str, bool]:
    """The kind, and whether to import what is of it. (tyro would take longer to import than the list takes.)"""
    for word in argv:
        if word.startswith("-") and word != FULL:
            raise BadInputError(f"{word} is not a field of 'mathnavi list'; allowed: {FULL}")
        if word != FULL and word not in KINDS:
            raise BadInputError(f"kind = {word}; allowed: {', '.join(KINDS)}")
    kinds = [word for word in argv if word != FULL]
    if len(kinds) > 1:
        raise BadInputError(f"kind = {' '.join(kinds)}; allowed: one of {', '.join(KINDS)}")
    return kinds[0] if kinds else ALL, FULL in argv


def listing(kind: str, points: Sequence[EntryPoint], full: bool) -> Table:
    """The plug-ins of one kind: name, and below one another what it is, its fields and where it comes from."""
    table = Table(title=kind, title_justify="left", title_style="bold", show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for point in points:
        try:
            first_line, fields = (_imported if full else _read)(point, kind in WITH_FIELDS)
        except Exception as error:  # one broken plug-in must not hide the others
            said, fields = Text(f"cannot be imported: {error}", style="red"), []
        else:
            said = Text(first_line)
        if fields:
            said.append(f"\n{WITH_FIELDS[kind]}: {', '.join(fields)}", style="dim")
        source = f"{_version(point.dist)}, " if point.dist else ""
        said.append(f"\n{source}{point.value}", style="dim")
        table.add_row(point.name, said)
    return table


def claimed_properties(points: Sequence[EntryPoint]) -> Group:
    """What each estimator claims to be with its default fields, and below it what there is to add."""
    from mathnavi.sim.interfaces.observer_properties import ObserverProperties

    table = Table(title=CLAIMED, title_justify="left", title_style="bold", box=None, padding=(0, 1, 0, 0))
    table.add_column("name", style="bold", no_wrap=True)
    for heading in ("attraction", "rate", "inputs", "observer", "system", "truth"):
        table.add_column(heading, overflow="fold")
    notes = []
    for point in points:
        try:
            plugin = point.load()
            claimed = plugin.properties(plugin.Config()) if hasattr(plugin, "properties") else None
        except Exception as error:  # one broken plug-in must not hide the others
            table.add_row(point.name, Text(f"broken: {error}", style="red"))
            continue
        if not isinstance(claimed, ObserverProperties):
            table.add_row(point.name, Text("not declared", style="dim"))
            continue
        kinds = (claimed.domain_of_attraction, claimed.rate, claimed.input_dependence)
        domains = (claimed.observer_domain, claimed.system_domain)
        words = (str(each.value) for each in (*kinds, *domains))
        table.add_row(point.name, *words, "kept" if claimed.stays_on_truth else "left")
        if claimed.note:
            notes.append(Text(f"{point.name}: {claimed.note}", style="dim"))
    return Group(table, *notes)


def _read(point: EntryPoint, with_fields: bool) -> tuple[str, list[str]]:
    """First line of a plug-in, and its fields if asked for, from its source; imported where that does not tell them."""
    try:
        plugin = definition(point.module, point.attr)
        return plugin.first_line, [_flag(field.name) for field in config_fields(plugin)] if with_fields else []
    except UnreadableError:
        return _imported(point, with_fields)


def _imported(point: EntryPoint, with_fields: bool) -> tuple[str, list[str]]:
    plugin: Any = point.load()
    config = getattr(plugin, "Config", None) if with_fields else None
    fields = [_flag(field.name) for field in dataclasses.fields(config)] if config else []
    return (plugin.__doc__ or "").strip().partition("\n")[0], fields


def _flag(name: str) -> str:
    return name.replace("_", "-")


@cache
def _version(source: Distribution) -> str:
    return f"{source.name} {source.version}"
