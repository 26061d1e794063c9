"""``mathnavi list``: the plug-ins that are installed, and where they come from.

Names come from the entry points, descriptions from the sources, fields from the index of plug-ins: nothing is
imported, so that the list appears at once. With ``--full`` all are imported, and the properties that estimators claim
are added.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib.metadata import EntryPoint

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from mathnavi.commands.errors import BadInputError
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.field_table import flag_of
from mathnavi.sim.plugin.groups import GROUPS, PREFIXES, installed
from mathnavi.sim.plugin.index import Description, Index, imported, sourced

ALL, FULL, VERBOSE = "all", "--full", "--verbose"
OWN = "mathnavi"  # distribution whose plug-ins stand without its name
KINDS = tuple(sorted((ALL, *GROUPS)))
USAGE = f"""usage: mathnavi list [KIND] [{VERBOSE}] [{FULL}]

List the installed plug-ins, of one kind or of all. {VERBOSE} adds their fields and their origin; {FULL} also \
imports them: it names those that cannot be used, and adds the declared properties of estimators.

KIND: {", ".join(KINDS)}"""
CLAIMED = (
    "claimed (Table 2.1): domain of attraction, rate of convergence, input dependence, domains of operation of the "
    "observer and of the system; whether it stays on the truth (Property 2.1)"
)


def main(argv: Sequence[str]) -> int:
    if {"-h", "--help"} & set(argv):
        print(wrapped(USAGE))
        return 0
    kind, full, verbose = read_words(argv)
    if full:
        from mathnavi.commands import opengl

        opengl.import_physics()
    console = Console(markup=False, emoji=False)
    for each in GROUPS if kind == ALL else (kind,):
        points = installed(each)
        console.print(
            listing(each, points, full, verbose) if points else Text.assemble((each, "bold"), "\n  none installed")
        )
        console.print()
        if full and each == "estimators" and points:
            console.print(claimed_properties(points))
            console.print()
    return 0


def read_words(argv: Sequence[str]) -> tuple[str, bool, bool]:
    """Return the kind, whether to import its plug-ins, and whether to print their fields; else BadInputError."""
    for word in argv:
        if word.startswith("-") and word not in (FULL, VERBOSE):
            raise BadInputError(f"{word} is not a field of 'mathnavi list'; allowed: {VERBOSE}, {FULL}")
        if not word.startswith("-") and word not in KINDS:
            raise BadInputError(f"kind = {word}; allowed: {', '.join(KINDS)}")
    kinds = [word for word in argv if not word.startswith("-")]
    if len(kinds) > 1:
        raise BadInputError(f"kind = {' '.join(kinds)}; allowed: one of {', '.join(KINDS)}")
    return kinds[0] if kinds else ALL, FULL in argv, bool({FULL, VERBOSE} & set(argv))


def listing(kind: str, points: Sequence[EntryPoint], full: bool, verbose: bool) -> Table:
    """Return the plug-ins of one kind: name and description; with ``verbose`` also fields and origin, below.

    They are imported here with ``full``, described by the index with ``verbose``, else by their sources.
    """
    table = Table(title=kind, title_justify="left", title_style="bold", show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    found = _found(kind, points, full, verbose)
    taken = Counter(plugin.name for plugin in found)
    for plugin in found:
        text = Text(f"cannot be imported: {plugin.error}", style="red") if plugin.error else Text(plugin.first_line)
        fields = dict.fromkeys(flag_of(field.path.partition(".")[0])[2:] for field in plugin.fields)
        if verbose and fields and kind in PREFIXES:
            text.append(f"\n--{PREFIXES[kind]}: {', '.join(fields)}", style="dim")
        if taken[plugin.name] > 1:
            text.append(f"\nrefused: {taken[plugin.name]} plug-ins have this name", style="red")
        foreign = "" if plugin.distribution.partition(" ")[0] == OWN else plugin.distribution
        if verbose:
            source = f"{plugin.distribution}, " if plugin.distribution else ""
            text.append(f"\n{source}{plugin.value}", style="dim")
        elif foreign:
            text = Text.assemble((f"({foreign}) ", "dim"), text)
        table.add_row(plugin.name, text)
    return table


def _found(kind: str, points: Sequence[EntryPoint], full: bool, verbose: bool) -> list[Description]:
    if verbose and not full:
        return Index.read().describe(*((kind, point) for point in points))
    return [(imported if full else sourced)(kind, point) for point in points]


def claimed_properties(points: Sequence[EntryPoint]) -> Group:
    """Return a table of the properties that each estimator claims with its default fields, with notes below it."""
    from mathnavi.interfaces.observer_properties import ObserverProperties

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
