"""Parts of pages that are generated from the software when the pages are built, so that they are never out of date.

A line ``<!-- generated: NAME -->`` of a page is replaced by the Markdown that ``PARTS[NAME]`` returns, and a line
``<!-- outside: PATH -->`` by a file of the repository, with its links adapted to the page.
"""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import io
import logging
import os
import re
import textwrap
from collections.abc import Callable
from enum import Enum
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Union, get_type_hints

from sphinx.application import Sphinx
from sphinx.builders.html import StandaloneHTMLBuilder

from mathnavi.commands import cli, opengl
from mathnavi.commands.flown import CommonOptions
from mathnavi.commands.known import LOG_OPTIONS, OPTIONS
from mathnavi.controllers.flight.guarantee import RULES
from mathnavi.interfaces.bounds import declared
from mathnavi.interfaces.field_table import Field, Form, leaves_of
from mathnavi.sim.plugin.groups import GROUPS
from mathnavi.sim.plugin.registry import load, names

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = "88"  # of the terminal that helps are printed for
KINDS = {float: "number", int: "whole number", bool: "yes or no", str: "text", Path: "path"}


def commands() -> str:
    """Return every command: its purpose, its help as printed, and its flags if the help leaves them to a scenario."""
    parts = []
    for name, (_, purpose) in cli.COMMANDS.items():
        usage = _printed(name, "--help")
        parts.append(f"## mathnavi {name}\n\n{purpose[0].upper()}{purpose[1:]}.\n\n{_fence(usage)}")
        for action in dict.fromkeys(re.findall(rf"^(?:usage:)? *mathnavi {name} ([a-z]\w*) ", usage, re.MULTILINE)):
            parts.append(f"### mathnavi {name} {action}\n\n{_fence(_printed(name, action, '--help'))}")
        if name in OPTIONS and "--help " not in usage.partition("options")[2]:  # else the help has shown them
            parts.append(table(EntryPoint(name, OPTIONS[name], "").load()))
        if name == "estimate":
            parts.append("Over a log of your own:")
            parts += [table(EntryPoint(name, place, "").load()) for place in LOG_OPTIONS]
    return "\n\n".join(parts)


def common() -> str:
    """Return the flags that all scenarios have."""
    return table(CommonOptions)


def scenarios() -> str:
    """Return every scenario: its description, its default controller and estimator, and its fields."""
    parts = []
    for name in names("scenarios"):
        scenario = load("scenarios", name)
        parts.append(
            f"## {name}\n\n{_docstring(scenario)}\n\n"
            f"```sh\nmathnavi run {name}\n```\n\n"
            f"Controller `{scenario.controller}`, estimator `{scenario.estimator}`, unless others are asked for.\n\n"
            f"{table(scenario.Config)}"
        )
    return "\n\n".join(parts)


def guarantee() -> str:
    """Return the rules of the state machine of a guarantee, in the order in which they are tried."""
    rows = [(f"`guarantee-{rule.state.value}`", rule.when) for rule in RULES]
    return _rows(("state", "at a control step at which"), rows)


def plug_ins() -> str:
    """Return every plug-in of every kind, with the fields of those that have any."""
    parts = []
    for kind, group in GROUPS.items():
        points = sorted(entry_points(group=group))
        rows = [(_code(point.name), _first_paragraph(point.load()), _code(point.value)) for point in points]
        parts.append(f"## {kind.capitalize()}\n\nGroup `{group}`.\n\n{_rows(('name', 'what it is', 'class'), rows)}")
        prefix = {"controllers": "planner", "estimators": "estimator"}.get(kind)
        for point in points if prefix else ():
            plugin = point.load()
            mission = get_type_hints(plugin.build).get("mission")
            fits = f" It is built for a `{mission.__name__}`." if isinstance(mission, type) else ""
            parts.append(f"### {point.name}\n\n{_docstring(plugin)}{fits}\n\n{table(plugin.Config, prefix or '')}")
    return "\n\n".join(parts)


PARTS: dict[str, Callable[[], str]] = {
    "commands": commands, "common": common, "scenarios": scenarios, "plug-ins": plug_ins, "guarantee": guarantee,
}  # fmt: skip


def table(owner: type, prefix: str = "") -> str:
    """Return the flags of a frozen dataclass: kind of value, what is allowed, default and meaning."""
    factories = {entry.name: entry.default_factory for entry in dataclasses.fields(owner)}
    rows = []
    for leaf in leaves_of(owner, prefix):
        default = _asked(factories.get(leaf.path)) or _shown(leaf.default)
        if not leaf.positional:
            rows.append((_code(leaf.flag), _kind(leaf.form), _allowed(leaf), default, _escaped(leaf.help)))
    return _rows(("flag", "value", "allowed", "default", "meaning"), rows) if rows else "It has no fields."


def _asked(factory: Any) -> str:
    """Return the description of a default that depends on the machine, for its value; "" for another default."""
    asks = inspect.isfunction(factory) and factory.__doc__
    return _shown(inspect.cleandoc(asks).partition("\n")[0].rstrip(".")) if asks else ""


def _allowed(leaf: Field) -> str:
    """Return the bounds of a field in the words of the message that refuses a value; "" for choices, and without."""
    choices = leaf.form.choices
    words = dict.fromkeys(bound.allowed for bound in declared(leaf.owner) if bound.name == leaf.name and not choices)
    return _escaped("; ".join(words).removeprefix("a finite value "))


def _kind(form: Form) -> str:
    """Return the kind of value that a flag takes, in words."""
    items = [_kind(item) for item in form.members]
    if form.origin is Union:
        return " or ".join(dict.fromkeys(items))
    if items and form.fixed:
        alike = len({*items}) == 1 and form.members[0].kind in KINDS
        return f"{len(items)} {items[0]}s" if alike else ", ".join(items)
    if items:
        return f"{items[0]}, repeatable" if form.origin in (tuple, list) else "value"
    if form.choices and form.kind is not bool:
        return ", ".join(map(_code, form.choices))
    return KINDS.get(form.kind, getattr(form.kind, "__name__", "value"))


def _shown(value: Any) -> str:
    if value is dataclasses.MISSING:
        return "required"
    if value is None or value in ("", ()):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Enum):
        return _code(value.name)
    if isinstance(value, (tuple, list)):
        return " ".join(_shown(item) for item in value)
    return _code(f"{value:.6g}" if isinstance(value, float) else str(value))


def _docstring(documented: Any) -> str:
    return "\n\n".join(_escaped(paragraph) for paragraph in inspect.cleandoc(documented.__doc__ or "").split("\n\n"))


def _first_paragraph(documented: Any) -> str:
    return _escaped(inspect.cleandoc(documented.__doc__ or "").partition("\n\n")[0])


def _printed(*words: str) -> str:
    """Return the help text of a command in a terminal with ``COLUMNS``."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = COLUMNS
    try:
        with contextlib.redirect_stdout(io.StringIO()) as out:
            code = cli.main(words)
    finally:
        os.environ.pop("COLUMNS")
        if before is not None:
            os.environ["COLUMNS"] = before
    if code:
        raise RuntimeError(f"mathnavi {' '.join(words)} ends with {code}")
    lines = [line.rstrip() for line in re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue()).strip().splitlines()]
    return "\n".join(part for line in lines for part in _broken(line))


def _broken(line: str) -> list[str]:
    if len(line) <= int(COLUMNS):
        return [line]
    return textwrap.wrap(line, int(COLUMNS), subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)


def _fence(text: str) -> str:
    return f"```text\n{text}\n```"


def _code(text: str) -> str:
    return f"`{text}`".replace("|", "\\|") if text else ""


def _escaped(text: str) -> str:
    """Return a text escaped for Markdown, in one line; double backquotes mark a literal, as in the source."""
    parts = re.split(r"``(.+?)``", " ".join(text.split()))
    for k, part in enumerate(parts):
        parts[k] = _code(part) if k % 2 else re.sub(r"([\\*_`|<>\[\]$#{}])", r"\\\1", part)
    return "".join(parts)


def _rows(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join(["{.data}", *(f"| {' | '.join(cells)} |" for cells in lines)])


PAGES = {"ARCHITECTURE.md": ROOT / "docs" / "architecture.md", "CHANGELOG.md": ROOT / "docs" / "changelog.md"}
"""pages that hold a file from outside"""


def outside(path: str, page: Path) -> str:
    """Return a file of the repository with links and pictures adapted to a page."""
    file = ROOT / path

    def moved(found: re.Match[str]) -> str:
        target = found[2]
        if re.match(r"[a-z]+:|#", target):
            return found[0]
        there = (file.parent / target.partition("#")[0]).resolve()
        there = PAGES.get(there.relative_to(ROOT).as_posix(), there)
        return f"{found[1]}{os.path.relpath(there, page.parent)}{found[3]}"

    text = file.read_text(encoding="utf-8")
    text = re.sub(r"\[([\w-]+\.(?:png|webp))\]\(\1\)", r"[![\1](\1)](\1)", text)  # of a table of pictures: the picture
    text = re.sub(r"(\]\()([^)\s]+)(\))", moved, text)
    return re.sub(r'((?:src|href)=")([^"]+)(")', moved, text)


def fill(app: Sphinx, docname: str, source: list[str]) -> None:
    """Insert the generated parts and the files of the repository into a page."""
    page = Path(app.env.doc2path(docname))

    def part(found: re.Match[str]) -> str:
        kind, argument = found[1], found[2]
        if kind == "generated":
            return PARTS[argument]()
        app.env.note_dependency(str(ROOT / argument))
        return outside(argument, page)

    source[0] = re.sub(r"^<!-- (generated|outside): (\S+) -->$", part, source[0], flags=re.MULTILINE)


def setup(app: Sphinx) -> dict[str, bool]:
    opengl.import_physics()  # before a scenario imports mujoco
    for name in ("absl", "OpenGL"):  # they report what they have chosen, which is no warning
        logging.getLogger(name).setLevel(logging.WARNING)
    StandaloneHTMLBuilder.supported_image_types = [*StandaloneHTMLBuilder.supported_image_types, "image/webp"]
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
