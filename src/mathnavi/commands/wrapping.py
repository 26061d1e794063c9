"""Usage texts as wide as the terminal: lines are broken between words."""

from __future__ import annotations

import re
import shutil
import textwrap


def wrapped(text: str) -> str:
    """Return the text with lines that fit into the terminal; a continued line is indented like the words above it.

    These begin after the first gap of two blanks ("  run     fly ...") or the first colon ("SCENARIO: ..."), else where
    the line begins. A line that fits stays unchanged.
    """
    width = shutil.get_terminal_size().columns
    return "\n".join(line if len(line) <= width else _broken(line, width) for line in text.splitlines())


def _broken(line: str, width: int) -> str:
    found = re.match(r" *\S+(?: \S+)* {2,}| *\w+: | *", line)
    assert found is not None  # the last branch matches any line
    return textwrap.fill(
        line,
        width,
        subsequent_indent=" " * len(found[0]),
        break_long_words=False,
        break_on_hyphens=False,
    )
