"""``mathnavi list``: what is installed, and where it comes from."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Literal

import tyro
from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from sim.commands import arguments, opengl
from sim.commands.arguments import parse
from sim.observer_properties import ObserverProperties
from sim.plugins import GROUPS

CLAIMED = (
    "claimed (Table 2.1): domain of attraction, rate of convergence, input dependence, domains of operation of the "
    "observer and of the system; whether it stays on the truth (Property 2.1)"
)
WITH_FIELDS = {"controllers": "--planner", "estimators": "--estimator"}


@dataclass(frozen=True)
class Options:
    """What to list."""

    kind: tyro.conf.Positional[
        Literal["all", "controllers", "estimators", "consensus", "scenarios", "studies", "terrains"]
    ] = "all"
    """kind of plug-in"""


def main(argv: Sequence[str]) -> int:
    try:
        (options,) = parse(argv, "mathnavi list", "List the plug-ins that are installed.", arguments.Group(Options))
    except SystemExit:  # the help is printed
        return 0
    opengl.choose()
    console = Console()
    for kind in GROUPS if options.kind == "all" else (options.kind,):
        points = sorted(entry_points(group=GROUPS[kind]))
        console.print(listing(kind, points) if points else f"[bold]{kind}[/bold]\n  none installed")
        console.print()
        if kind == "estimators" and points:
            console.print(claimed_properties(points))
            console.print()
    return 0


def listing(kind: str, points: Sequence[EntryPoint]) -> Table:
    """The plug-ins of one kind: name, and below one another what it is, its fields and where it comes from."""
    table = Table(title=kind, title_justify="left", title_style="bold", show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for point in points:
        try:
            plugin = point.load()
        except Exception as error:  # one broken plug-in must not hide the others
            said, fields = Text(f"cannot be imported: {error}", style="red"), ""
        else:
            said, fields = Text((plugin.__doc__ or "").strip().partition("\n")[0]), _fields(plugin)
        if kind in WITH_FIELDS and fields:
            said.append(f"\n{WITH_FIELDS[kind]}: {fields}", style="dim")
        source = f"{point.dist.name} {point.dist.version}, " if point.dist else ""
        said.append(f"\n{source}{point.value}", style="dim")
        table.add_row(point.name, said)
    return table


def claimed_properties(points: Sequence[EntryPoint]) -> Group:
    """What each estimator claims to be with its default fields, and below it what there is to add."""
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


def _fields(plugin: Any) -> str:
    config = getattr(plugin, "Config", None)
    return ", ".join(field.name.replace("_", "-") for field in dataclasses.fields(config)) if config else ""
