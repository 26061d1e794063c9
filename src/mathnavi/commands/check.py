"""``mathnavi check``: what fits of an MJCF file or of a plug-in, and what is missing, before a run."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.check_findings import CheckResult
from mathnavi.commands.command_line import prepare
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.field_table import Positional, ValueName
from mathnavi.interfaces.reading.files import MEBIBYTE, read_text
from mathnavi.sim.plugin.registry import names

DESCRIPTION = (
    "Check an MJCF file, or a scenario, controller or estimator, before a run: what fits, and what is missing, with "
    "the line to write. Exit code 0: nothing is missing; 1: something is."
)


PLUGINS = ("scenarios", "controllers", "estimators", "consensus")


@configuration
class CheckOptions:
    """Words of the command: what is checked."""

    subject: Annotated[str, Positional("MODEL.xml|MODULE:Class")]
    """path of an MJCF file, dm_control:NAME or menagerie:NAME; or a plug-in: its name, MODULE:Class or FILE.py:Class"""
    mission: Annotated[str | None, ValueName("FILE.py:NAME|MODULE:NAME")] = None
    """description of the vehicle and its sensors, of an estimator over a log: an object, or a function that returns
    one, of a Python file, FILE.py:NAME, or of a module, package.module:NAME; one in the estimator's own file if not
    given"""


def main(argv: Sequence[str]) -> int:
    (options,) = parse(argv, "mathnavi check", DESCRIPTION, FlagGroup(CheckOptions))
    prepare()
    with bad_input():
        result = _checked(options.subject, options.mission or "")
    _print(result)
    return 0 if result.fits else 1


def _checked(subject: str, mission: str) -> CheckResult:
    module, colon, _ = subject.partition(":")
    installed = any(subject in names(kind) for kind in PLUGINS)
    if installed or (colon and module not in ("dm_control", "menagerie") and not Path(subject).is_file()):
        from mathnavi.commands.check_plugin import check_plugin

        return check_plugin(subject, mission)
    if not colon and subject.endswith(".py") and Path(subject).is_file():
        raise BadInputError(f"{subject} is a file of Python code; {_allowed_of(Path(subject))}")
    if mission:
        raise BadInputError(f"--mission with {subject}; allowed: with an estimator, MODULE:Class or FILE.py:Class")
    from mathnavi.commands.check_model import check_model

    return check_model(subject)


def _allowed_of(file: Path) -> str:
    """Return what a file of Python code allows, by the classes and the other names that it defines."""
    try:
        body = ast.parse(read_text(file, ValueError, MEBIBYTE)).body
    except (SyntaxError, ValueError):
        body = []
    classes = [node.name for node in body if isinstance(node, ast.ClassDef)]
    named = [each.id for node in body for each in _names_in(node)]
    name = "mission" if "mission" in named else next(iter(named), "NAME")
    of_class = f"`mathnavi check {file}:{classes[0] if classes else 'CLASS'}` for the class of a plug-in"
    of_mission = f"`mathnavi check ESTIMATOR --mission {file}:{name}` for a mission"
    return f"allowed: {of_class}, {of_mission}"


def _names_in(node: ast.stmt) -> list[ast.Name]:
    """Return the names to which a statement assigns."""
    return [each for each in node.targets if isinstance(each, ast.Name)] if isinstance(node, ast.Assign) else []


def _print(result: CheckResult) -> None:
    console = Console(markup=False, emoji=False, highlight=False)
    stopping = [finding for finding in result.findings if finding.stops]
    refused = any(finding.word == "refused" for finding in stopping)
    verdict = "MuJoCo refuses it" if refused else f"{len(stopping)} missing" if stopping else "nothing is missing"
    console.print(f"{result.subject}: {verdict}", style="bold")
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    for heading, text in result.facts:
        table.add_row(heading, Text(text))
    for finding in (*stopping, *(each for each in result.findings if not each.stops)):
        word, colour = (finding.word, "bold red") if finding.stops else ("note", "yellow")
        table.add_row(Text(word, colour), Text(finding.what))
        if finding.write:
            table.add_row("write", Text(finding.write, "bold"))
    console.print(table)
    if result.command:
        console.print(f"run     {result.command}", soft_wrap=True)
