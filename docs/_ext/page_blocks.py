"""The blocks of a page that are run: by the tests as they stand, and in the page's notebook as its cells.

```python     code, in one module per page
```output     after a python block: what that block prints
```console    lines "$ COMMAND", each followed by what it prints; "# exit N" above: the status of the last
```python     of any language, with a first line "# NAME.py" or "<!-- NAME.xml -->": a file, or the next part of it
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
EXIT = re.compile(r"# exit (\d+)\n")
_FILE = re.compile(r"(?:# ([\w-]+\.\w+)|<!-- ([\w-]+\.\w+) -->)\n")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    kind: str
    text: str
    line: int  # of the page, at which the text begins
    place: tuple[int, int] = (0, 0)  # of the block in the page, from its first fence to the end of its last

    @property
    def file(self) -> str:
        """The name of the file that the block shows; "" for what is run."""
        named = _FILE.match(self.text) if self.kind not in ("console", "output") else None
        return (named[1] or named[2]) if named else ""


def blocks_of(page: str) -> list[Block]:
    """Return the blocks of a page that are run or written, and what they print, in order."""
    blocks = [
        Block(found[1], found[2], page.count("\n", 0, found.start(2)) + 1, found.span())
        for found in FENCE.finditer(page)
    ]
    return [block for block in blocks if block.file or block.kind in ("python", "output", "console")]


def commands_of(text: str) -> Iterator[tuple[str, list[str]]]:
    """Yield each command of a console block, continued lines joined, and the lines that it prints."""
    command, output = "", list[str]()
    for line in text.splitlines():
        if command.endswith("\\"):
            command = f"{command[:-1].rstrip()} {line.removeprefix('> ').strip()}"
        elif line.startswith("$ "):
            if command:
                yield command, output
            command, output = line[2:], []
        else:
            output.append(line)
    if command:
        yield command, output
