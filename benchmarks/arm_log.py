"""Joint velocities from the log of a real arm: the default observer and filters that are tuned on another log.

    python -m benchmarks.arm_log --tune LOG --test LOG --mechanism NAME|FILE.xml --position SIGNALS --inputs SIGNALS

The filters, their tuning and the reference are those of ``mathnavi study real`` (``studies/real/arm_filters.py``), on
your own logs. The reference is not the truth: it comes from the positions of the log, future ones included.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.table import Table

from benchmarks.arguments import read_arguments
from mathnavi.commands.errors import one_line
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.field_table import ValueName
from mathnavi.interfaces.reading.table_format import names_in
from mathnavi.sim.logs.formats import read_log
from mathnavi.studies.real.arm_filters import NOISE, Filtered, compare


@configuration
class Arguments:
    """Compare observers of joint velocities on the log of a real arm."""

    tune: Annotated[Path, ValueName("LOG")]
    """log on which the arm is identified and the rivals are tuned"""
    test: Annotated[Path, ValueName("LOG")]
    """log on which all are compared"""
    mechanism: Annotated[str, ValueName("NAME|FILE.xml")]
    """arm with the inertial parameters of its links"""
    position: Annotated[str, ValueName("SIGNALS")]
    """signals of the positions of the joints, with commas between them"""
    inputs: Annotated[str, ValueName("SIGNALS")]
    """signals of currents or torques, with commas between them"""
    noise: float = NOISE
    """standard deviation of a position that the filters assume [rad]"""
    out: Path = Path("renders/out/arm_log.json")
    """file of the figures"""


def compared(arguments: Arguments) -> dict[str, Filtered]:
    """Every filter by its name, on the log that it is tested on."""
    tune, test = (read_log(each) for each in (arguments.tune, arguments.test))
    position, inputs = names_in(arguments.position), names_in(arguments.inputs)
    return compare(tune, [test], arguments.mechanism, position, inputs, arguments.noise)[0]


def main() -> None:
    arguments = read_arguments(Arguments)
    try:
        found = compared(arguments)
    except (ValueError, OSError) as error:  # no such log, for one: such data are not part of this repository
        print(f"python -m benchmarks.arm_log: {one_line(str(error))}", file=sys.stderr)
        sys.exit(2)
    table = Table(title=f"velocity on {arguments.test}, tuned on {arguments.tune}", box=None)
    for heading in ("filter", "parameter", "error, RMS [rad/s]"):
        table.add_column(heading)
    for name, each in found.items():
        table.add_row(name, each.parameter, f"{each.error:.5f}")
    Console(markup=False, emoji=False).print(table)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps({name: each.error for name, each in found.items()}, indent=2))


if __name__ == "__main__":
    main()
