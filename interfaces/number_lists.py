"""Lists of numbers as fields of a configuration: ``--start 0.2 0.3``, one flag with all of its values.

Without this the command line would need one flag for each value.
"""

from __future__ import annotations

from typing import Annotated

import tyro

NumberList = Annotated[
    tuple[float, ...],
    tyro.constructors.PrimitiveConstructorSpec(
        nargs="*",
        metavar="FLOAT...",
        instance_from_str=lambda words: tuple(float(word) for word in words),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda value: [f"{number:g}" for number in value],
    ),
]
