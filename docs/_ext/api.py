"""Pages of the API, one for each folder, generated from the sources before the other pages are read.

The sources are parsed, not imported: so a compiled function keeps its signature, types and defaults are printed as
written, and the comment next to a field, with its shape, unit and frame, is printed with it.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from prose import inline, prose
from sphinx.application import Sphinx

from mathnavi.interfaces.field_table import beside

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    "interfaces", "models", "controllers", "estimators", "sim", "renders", "studies",
    "commands", "scripting", "learning",
)  # fmt: skip
SOURCES = ROOT / "src" / "mathnavi"  # where each package is, or a link to it
HEADING = {"index": "=", "module": "-"}
Function = ast.FunctionDef | ast.AsyncFunctionDef


class Module:
    """A source file: its tree, what its names mean, and its lines."""

    def __init__(self, path: Path) -> None:
        self.path, self.name = path, ".".join(("mathnavi", *path.relative_to(SOURCES).with_suffix("").parts))
        source = path.read_text(encoding="utf-8")
        self.tree = ast.parse(source)
        self.lines = source.splitlines()
        self.meaning = dict(self._meaning())

    def _meaning(self) -> Iterator[tuple[str, str]]:
        """Yield every name imported or defined in the module, with its full name, since short names are ambiguous."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                yield from ((name.asname or name.name, f"{node.module}.{name.name}") for name in node.names)
        for node in self.tree.body:
            if isinstance(node, (ast.ClassDef, Function)):
                yield node.name, f"{self.name}.{node.name}"
            elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                yield node.targets[0].id, f"{self.name}.{node.targets[0].id}"

    def type_text(self, annotation: ast.expr | None) -> str:
        """Return an annotation with each name of mathnavi qualified by its module, so that links are unambiguous."""
        if annotation is None:
            return ""
        text = ast.unparse(_Qualified(self.meaning).visit(ast.parse(ast.unparse(annotation), mode="eval")).body)
        return re.sub(r"\((~[\w.]+)\)", r"\1", text)


class _Qualified(ast.NodeTransformer):
    def __init__(self, meaning: dict[str, str]) -> None:
        self.meaning = meaning

    def visit_Name(self, node: ast.Name) -> ast.expr:
        # A tilde: the last part of the name is shown.
        meant = self.meaning.get(node.id)
        return ast.parse(f"~{meant}" if meant else node.id, mode="eval").body


def page(folder: Path, modules: Sequence[Module]) -> str:
    """Return the page of one folder: a table of its modules, then each module with its classes and functions."""
    title = ".".join(("mathnavi", *folder.relative_to(ROOT).parts))
    lines = [
        ".. highlight:: text",
        "",
        *_heading(title, "index"),
        ".. list-table::",
        "   :widths: 22 78",
        "   :class: modules",
        "",
    ]
    for module in modules:
        first = (ast.get_docstring(module.tree) or "").partition("\n\n")[0]
        lines += [f"   * - :py:mod:`~{module.name}`", f"     - {inline(first)}"]
    lines.append("")
    for module in modules:
        lines += [*_heading(module.path.stem, "module"), f".. py:module:: {module.name}", ""]
        lines += [f"``{module.path.relative_to(ROOT)}``", ""]
        lines += prose(ast.get_docstring(module.tree))
        lines += _members(module, module.tree.body, None)
    return "\n".join(lines) + "\n"


def _heading(text: str, level: str) -> list[str]:
    return [inline(text), HEADING[level] * (len(text) + 4), ""]


def _members(module: Module, body: Iterable[ast.stmt], owner: ast.ClassDef | None) -> list[str]:
    """Return the public statements of a module or a class as reStructuredText."""
    lines: list[str] = []
    statements = list(body)
    for k, node in enumerate(statements):
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            lines += _class(module, node)
        elif isinstance(node, Function) and _shown(node, owner):
            lines += _function(module, node, owner)
        elif isinstance(node, (ast.AnnAssign, ast.Assign)):
            below = statements[k + 1] if k + 1 < len(statements) else None
            lines += _data(module, node, below, owner)
    return lines


def _shown(node: Function, owner: ast.ClassDef | None) -> bool:
    if any(ast.unparse(mark).endswith("overload") for mark in node.decorator_list):
        return False  # the implementation stands below, with the docstring
    return not node.name.startswith("_") or (owner is not None and node.name == "__call__")


def _class(module: Module, node: ast.ClassDef) -> list[str]:
    bases = [ast.unparse(base) for base in node.bases]
    constructor = next((f for f in node.body if isinstance(f, ast.FunctionDef) and f.name == "__init__"), None)
    signature = f"({_arguments(module, constructor.args, skip=1)})" if constructor else ""
    inside = [f"Bases: {', '.join(f'``{base}``' for base in bases)}", ""] if bases else []
    inside += prose(ast.get_docstring(node))
    if constructor:
        inside += prose(ast.get_docstring(constructor))
    inside += _members(module, node.body, node)
    return _directive("class", f"{node.name}{signature}", (), inside)


def _function(module: Module, node: Function, owner: ast.ClassDef | None) -> list[str]:
    marks = {ast.unparse(mark).partition("(")[0].rpartition(".")[2] for mark in node.decorator_list}
    returns = module.type_text(node.returns)
    text = prose(ast.get_docstring(node))
    if marks & {"property", "cached_property"}:
        return _directive("property", node.name, ((":type:", returns),), text)
    kept = owner is None or "staticmethod" in marks
    signature = f"{node.name}({_arguments(module, node.args, skip=0 if kept else 1)}){returns and f' -> {returns}'}"
    options = tuple((f":{mark}:", "") for mark in ("staticmethod", "classmethod", "abstractmethod") if mark in marks)
    return _directive("function" if owner is None else "method", signature, options if owner else (), text)


def _data(
    module: Module, node: ast.AnnAssign | ast.Assign, below: ast.stmt | None, owner: ast.ClassDef | None
) -> list[str]:
    """Return a public field, or a public constant that is documented."""
    target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
    if not isinstance(target, ast.Name) or target.id.startswith("_"):
        return []
    said = beside(node, module.lines)
    if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) and isinstance(below.value.value, str):
        said = below.value.value
    if owner is None and not said:
        return []
    value = ast.unparse(node.value) if node.value is not None else ""
    options = [(":type:", module.type_text(node.annotation) if isinstance(node, ast.AnnAssign) else "")]
    if len(value) <= 100 and not value.startswith("field("):
        options.append((":value:", value))
    kind = "data" if owner is None else "attribute"
    return _directive(kind, target.id, [pair for pair in options if pair[1]], prose(said))


def _arguments(module: Module, arguments: ast.arguments, skip: int) -> str:
    """Return the parameters as written, without ``self`` and with qualified types."""
    copy: Any = ast.parse(f"def f({ast.unparse(arguments)}): ...").body[0]
    for kind in ("posonlyargs", "args"):
        parameters = getattr(copy.args, kind)
        dropped = min(skip, len(parameters))
        del parameters[:dropped]
        skip -= dropped
    every = [*copy.args.posonlyargs, *copy.args.args, *copy.args.kwonlyargs, copy.args.vararg, copy.args.kwarg]
    for parameter in every:
        if parameter is not None and parameter.annotation is not None:
            parameter.annotation = ast.parse(module.type_text(parameter.annotation), mode="eval").body
    return ast.unparse(copy.args)


def _directive(kind: str, signature: str, options: Iterable[tuple[str, str]], inside: Sequence[str]) -> list[str]:
    head = [f".. py:{kind}:: {signature}", *(f"   {name} {value}".rstrip() for name, value in options), ""]
    return [*head, *(f"   {line}".rstrip() for line in inside), ""]


def write_pages(app: Sphinx) -> None:
    """Write a page for every folder with modules, and the index; unchanged pages are not written."""
    folder = Path(app.srcdir) / "reference" / "api"
    pages = {}
    for package in PACKAGES:
        for place in sorted({path.parent for path in (SOURCES / package).rglob("*.py")}):
            paths = [path for path in sorted(place.glob("*.py")) if not path.stem.startswith("_")]
            if paths:
                pages[".".join(("mathnavi", *place.relative_to(SOURCES).parts))] = page(
                    place, [Module(path) for path in paths]
                )
    texts = {f"{name}.rst": text for name, text in pages.items()}
    folder.mkdir(parents=True, exist_ok=True)
    for stale in set(folder.glob("*.rst")) - {folder / name for name in texts}:
        stale.unlink()
    for name, text in texts.items():
        if not (folder / name).is_file() or (folder / name).read_text(encoding="utf-8") != text:
            (folder / name).write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
