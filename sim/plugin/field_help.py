"""Help texts of the fields of a dataclass: the string below, or the comment next to, each field in its source."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import io
import textwrap
import tokenize
from collections.abc import Mapping
from functools import cache


@cache
def field_help(schema: type) -> dict[str, str]:
    """Return the help by name of the field, of a dataclass and of its base classes; "" for a field without text.

    A field without a docstring below it takes the comment next to it. The result is empty if there is no source.
    """
    texts: dict[str, str] = {}
    for each in reversed([base for base in schema.__mro__ if dataclasses.is_dataclass(base)]):
        try:
            source = textwrap.dedent(inspect.getsource(each))
            statements = ast.parse(source).body[0].body  # type: ignore[attr-defined]
        except (OSError, TypeError, SyntaxError):  # defined by a call, or in a notebook
            continue
        remarks = comments(source)
        for field, below in zip(statements, [*statements[1:], None], strict=True):
            match field, below:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                    texts[name] = inspect.cleandoc(text)
                case ast.AnnAssign(target=ast.Name(id=name)), _:
                    texts[name] = beside(field, remarks)
    return texts


def comments(source: str) -> dict[int, tuple[int, str]]:
    """Return column and text of every comment, by the number of its line."""
    return {
        token.start[0]: (token.start[1], token.string.lstrip("# ").strip())
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }


def beside(node: ast.stmt, remarks: Mapping[int, tuple[int, str]]) -> str:
    """Return the comment next to a statement, with the lines that continue it below."""
    line = node.end_lineno or node.lineno
    column, text = remarks.get(line, (0, ""))
    while text and (below := remarks.get(line + 1)) and below[0] == column:
        line, text = line + 1, f"{text} {below[1]}"
    return text
