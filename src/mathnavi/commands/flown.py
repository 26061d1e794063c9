"""Front of `mathnavi run`, `sweep` and `search`: help and wrong words, before anything that flies is imported.

The index of plug-ins (``mathnavi.sim.plugin.index``) describes the flags of the command, of the scenario, and of its
controller and estimator. What it does not hold the command finds by importing them, and it is added to the index then.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.metadata import EntryPoint

from mathnavi.commands import opengl
from mathnavi.commands.arguments import FlagGroup, Section, given, read_words, value_of
from mathnavi.commands.errors import BadInputError, bad_plugin
from mathnavi.commands.known import OPTIONS
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.bounds import Seed, configuration
from mathnavi.sim.plugin.groups import KINDS, PREFIXES
from mathnavi.sim.plugin.index import COMMAND, Description, Index, Point, module_of
from mathnavi.sim.plugin.registry import called, names, point_of

USAGE = """usage: mathnavi {0} SCENARIO [OPTIONS]

SCENARIO: {1}

mathnavi {0} SCENARIO --help lists the options."""
Command = Callable[[Sequence[str]], int]
HEADING = "Fields of {} {}."
_FIRST = {"--from", "--vary", "--wall-deadline"}  # flags that decide what the others are, or are looked at before them


@configuration
class CommonOptions:
    """Flags of every scenario."""

    seed: Seed = 0
    """seed of every random draw: the same seed gives the same log, bit for bit"""
    controller: str = ""
    """controller: name of a plug-in, or package.module:Class; its fields are --planner.*"""
    estimator: str = ""
    """estimator: name of a plug-in, or package.module:Class; its fields are --estimator.*"""


def main(command: str, argv: Sequence[str], load: Callable[[], Command], *, whole_process: bool) -> int:
    """Print the usage, or call the command, which ``load`` imports, and return the exit code.

    A separate process, in which every class is what its source says, first looks at the words by the index, which
    raises HelpPrinted or BadInputError for them without the command.
    """
    if not argv:
        raise BadInputError(f"SCENARIO is missing; allowed: {', '.join(names('scenarios'))}")
    if argv[0] in ("-h", "--help"):
        print(wrapped(USAGE.format(command, ", ".join(names("scenarios")))))
        return 0
    if whole_process and not _FIRST & set(given(argv)):
        return _by_index(command, argv, load)
    return load()(argv)


def _by_index(command: str, argv: Sequence[str], load: Callable[[], Command]) -> int:
    opengl.check_choice()
    import_from_here()
    index = Index.read()
    try:
        line = _line(index, command, argv)
    except LookupError:
        try:
            return load()(argv)
        finally:
            with suppress(LookupError, BadInputError):
                _line(index, command, argv, imported=True)
    read_words(*line)
    return load()(argv)


def _line(
    index: Index, command: str, argv: Sequence[str], *, imported: bool = False
) -> tuple[Sequence[str], str, str, list[Section]]:
    """Return the arguments of ``read_words`` by the index, to which plug-ins are added that have been ``imported``.

    Raises LookupError if it does not hold all, BadInputError for an unknown plug-in.
    """
    name, *words = argv
    if name.startswith("-"):
        raise LookupError(name)
    chosen = {part: value_of(f"--{part}", words) for part in KINDS}
    with bad_plugin():
        options = (COMMAND, EntryPoint(OPTIONS[command], OPTIONS[command], ""))
        own, scenario = _described(index, [options, ("scenarios", point_of("scenarios", name))], imported)
        places = {part: scenario.stated[part] if value is None else value for part, value in chosen.items()}
        parts = _described(index, [(kind, point_of(kind, places[part])) for part, kind in KINDS.items()], imported)
    used = [called(part.kind, part.place) for part in parts]
    common = FlagGroup(CommonOptions, default=CommonOptions(0, *used)).section
    sections = [common, Section(own.fields), Section(scenario.fields)]
    for part, plugin, name_used in zip(KINDS, parts, used, strict=True):
        sections.append(Section(plugin.fields, PREFIXES[plugin.kind], HEADING.format(part, name_used)))
    if len({flag for section in sections for flag in section.flags}) < sum(len(section.flags) for section in sections):
        raise LookupError("two fields have one flag")
    return words, f"mathnavi {command} {name}", scenario.first_line, sections


def _described(index: Index, points: Sequence[Point], imported: bool) -> list[Description]:
    if not (index.holds(*points) or (imported and all(module_of(point) in sys.modules for _, point in points))):
        raise LookupError(points)
    found = index.describe(*points, apart=False)
    if not all(each.checked for each in found):
        raise LookupError(points)
    return found


def import_from_here() -> None:
    """Make a user's modules importable from the current folder, after all that is installed."""
    try:
        here = os.getcwd()
    except OSError as error:
        raise BadInputError(
            f"the folder in which the command is given: {error.strerror}; allowed: one that is there"
        ) from None
    if here not in sys.path:
        sys.path.append(here)
