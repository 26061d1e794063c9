"""Write the tables of licences, docs/reference/licences.md, from pyproject.toml and the metadata of what is installed.

    python docs/list_licences.py

The text outside of the tables is written by hand. Packages that are not installed keep their rows in the page; a
package without a row must be installed first.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, distribution, metadata, requires
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "licences.md"
TABLE = re.compile(r"(<!-- licences: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
ROW = re.compile(r"^\| `([\w.-]+)` \| ([^|]*) \| ([^|]*) \|$", re.MULTILINE)
TOOLS = ("dev", "docs")
LONGEST = 60  # [characters] of a field that names a licence; a longer one is its text


def wanted() -> dict[str, list[str]]:
    """The requirements of pyproject.toml: "" for what every installation has, and each extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return {"": project["dependencies"], **project["optional-dependencies"]}


def licence(name: str) -> str:
    """The licence as the metadata of an installed package state it; ValueError where they state none.

    In the order of what is precise: the SPDX expression, a short field "License", classifiers, the title of the text.
    """
    stated = metadata(name)
    if expression := stated.get("License-Expression"):
        return str(expression)
    field = str(stated.get("License") or "").strip()
    if field and len(field) <= LONGEST and "\n" not in field and "copyright" not in field.lower():
        return field
    classifiers = [str(each).split(" :: ") for each in stated.get_all("Classifier") or []]
    names = [each[-1] for each in classifiers if each[0] == "License" and len(each) > 1 and each[-1] != "OSI Approved"]
    texts = (distribution(name).read_text(f"licenses/{file}") for file in stated.get_all("License-File") or [])
    titles = [text.strip().partition("\n")[0].strip() for text in texts if text]
    names = names or [title for title in titles if title.endswith("License")]
    if not names:
        raise ValueError(f"{name}: its metadata state no licence; state it in {PAGE.name}")
    return ", ".join(names)


def closure(requirements: Iterable[str]) -> dict[str, str]:
    """Return all installed packages that requirements bring, with the packages that require them ("" for mathnavi)."""
    found: dict[str, str] = {}
    waiting = [(Requirement(text), "") for text in requirements]
    while waiting:
        requirement, by = waiting.pop(0)
        name = canonicalize_name(requirement.name)
        if name in found:
            continue
        found[name] = by
        try:
            inner = [Requirement(text) for text in requires(name) or []]
        except PackageNotFoundError:
            continue
        environments = [{"extra": extra} for extra in ("", *requirement.extras)]
        waiting += [
            (each, name)
            for each in inner
            if each.marker is None or any(each.marker.evaluate(environment) for environment in environments)
        ]
    return found


def groups() -> dict[str, dict[str, str]]:
    """The rows of the three tables: by package, for what it is there."""
    asked = wanted()
    installed = closure(asked[""])
    run = {name: f"needed by {by}" if by else "mathnavi" for name, by in installed.items()}
    extras: dict[str, str] = {}
    tools: dict[str, str] = {}
    for extra, requirements in asked.items():
        for name, by in closure(requirements).items() if extra else ():
            table = tools if extra in TOOLS else extras
            if name not in run and name not in extras:
                table.setdefault(name, f"`[{extra}]`" + (f", needed by {by}" if by else ""))
    return {"everybody": run, "extras": extras, "tools": tools}


def stated() -> dict[str, str]:
    """The licences that the page has, by package."""
    return {found[1]: found[2] for found in ROW.finditer(PAGE.read_text(encoding="utf-8"))}


def rows(group: Mapping[str, str], known: Mapping[str, str]) -> Iterator[str]:
    yield "| package | licence | for |\n|---|---|---|\n"
    for name, purpose in sorted(group.items()):
        try:
            found = licence(name)
        except (PackageNotFoundError, ValueError):
            if name not in known:
                raise
            found = known[name]
        yield f"| `{name}` | {found} | {purpose} |\n"


def written() -> str:
    """Return the page with the present tables."""
    tables, known = groups(), stated()
    text = PAGE.read_text(encoding="utf-8")
    return TABLE.sub(lambda found: f"{found[1]}{''.join(rows(tables[found[2]], known))}{found[3]}", text)


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
