"""Console that prints words as they are."""

from __future__ import annotations

from rich import console


class Console(console.Console):
    """Terminal on which brackets and colons of names, paths and errors are no markup: ``runs [v1]`` stays as it is."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False)
