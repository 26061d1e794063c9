"""Results of a benchmark: rows that compare this software with other software, their table, and its file.

A row holds the figures of R repetitions, in each of which both ran one after the other. It shows the median of each,
and the median, the least and the greatest of the R ratios of neighbouring runs; so a machine that is slower for a while
widens the spread but does not bias the ratio.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.files import write_json
from mathnavi.sim.sweep.execution import available_cores

Ratio = Literal["other / ours", "ours / other"]

WIDTH = 120  # of a console, so that the table stays whole wherever the output goes


@dataclass(frozen=True, eq=False)
class Comparison:
    """One row of the table."""

    what: str
    unit: str
    ours: Array  # (R,)
    other: Array  # (R,) of the runs beside them
    software: str  # the other
    ratio_of: Ratio
    """numerator and denominator of the ratio"""
    at_least: float | None = None
    """least ratio that meets the goal; None for no bound"""
    at_most: float | None = None

    @property
    def ratios(self) -> Array:
        """Ratio (R,) of each repetition."""
        return self.other / self.ours if self.ratio_of == "other / ours" else self.ours / self.other

    @property
    def ratio(self) -> float:
        return float(np.median(self.ratios))

    @property
    def wanted(self) -> str:
        bounds = ((">=", self.at_least), ("<=", self.at_most))
        return " ".join(f"{sign} {bound:g}" for sign, bound in bounds if bound is not None)

    @property
    def holds(self) -> bool | None:
        """True if the ratio meets its bound; None without a bound."""
        if not self.wanted:
            return None
        low = -np.inf if self.at_least is None else self.at_least
        high = np.inf if self.at_most is None else self.at_most
        return bool(low <= self.ratio <= high)

    def plain(self) -> dict[str, Any]:
        """Return the row as plain data."""
        return {
            "what": self.what,
            "unit": self.unit,
            "ours": float(np.median(self.ours)),
            "software": self.software,
            "other": float(np.median(self.other)),
            "ratio_of": self.ratio_of,
            "ratio": self.ratio,
            "ratio_least": float(self.ratios.min()),
            "ratio_greatest": float(self.ratios.max()),
            "repetitions": len(self.ratios),
            "wanted": self.wanted or None,
            "holds": self.holds,
        }


def within(what: str, unit: str, ours: Array, limit: float) -> Comparison:
    """Return the row of a figure (R,) whose goal is to be at most ``limit``."""
    return Comparison(what, unit, ours, np.full(len(ours), limit), "the goal", "ours / other", at_most=1.0)


class Findings(Protocol):
    """Result of one benchmark."""

    @property
    def title(self) -> str:
        """Description of the measurement in one line."""
        ...

    def comparisons(self) -> list[Comparison]:
        """Return the rows of the table."""
        ...

    def show(self, console: Console) -> None:
        """Print remarks on these rows."""
        ...

    def plain(self) -> dict[str, Any]:
        """Return all results as plain data."""
        ...


def load() -> list[float]:
    """Return the load average: runnable processes, over the last 1, 5 and 15 minutes."""
    return [round(mean, 2) for mean in os.getloadavg()]


@dataclass(frozen=True)
class Machine:
    """Machine and versions of the run."""

    processor: str
    cores: int  # that this process may use
    load: list[float] = field(default_factory=load)  # over the last 1, 5 and 15 minutes

    @staticmethod
    def here() -> Machine:
        return Machine(_processor(), available_cores())

    def plain(self) -> dict[str, Any]:
        packages = ["mathnavi", "mujoco", "dm-control", "casadi", "numpy", "numba", "filterpy"]
        packages += [name for name in ("do-mpc", "maptor", "dymos") if find_spec(name.replace("-", "_"))]
        versions = {name: version(name) for name in packages} | {"python": platform.python_version()}
        return {
            "processor": self.processor,
            "cores": self.cores,
            "system": f"{platform.system()} {platform.machine()}",
            "load_before": self.load,
            "load_after": load(),
            "versions": versions,
        }


def _processor() -> str:
    """Return the model name of the processor."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def table(parts: Sequence[Findings], machine: Mapping[str, Any], loads: Sequence[float] = ()) -> Table:
    """Return the table of all rows, with the load of each benchmark if given, and the machine in the caption."""
    cores = f"{machine['cores']} core{'s' * (machine['cores'] != 1)}"
    before, after = machine["load_before"][0], machine["load_after"][0]
    caption = (
        f"{machine['processor']}, {cores}; load {before:g} before, {after:g} after; "
        + ", ".join(f"{name} {number}" for name, number in machine["versions"].items())
        + ". Medians over the repetitions; the ratio is the median of those of neighbouring runs, the spread the least "
        "and the greatest of them."
    )
    shown = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), caption=caption, caption_justify="left")
    for heading in ("what", "ours", "other", "other software", "ratio", "spread", "of", "wanted"):
        numeric = heading in ("ours", "other", "ratio", "spread")
        shown.add_column(heading, justify="right" if numeric else "left", no_wrap=numeric)
    for k, part in enumerate(parts):
        if not (rows := part.comparisons()):
            continue
        beside = f"; load {loads[k]:.1f}" if loads else ""
        shown.add_row(f"[bold]{part.title}[/bold]{beside}")
        for row in rows:
            ours, other = (
                f"{_three_digits(float(np.median(samples)))} {row.unit}" for samples in (row.ours, row.other)
            )
            spread = f"{row.ratios.min():.3g} .. {row.ratios.max():.3g}"
            wanted = row.wanted + {True: " yes", False: " NO", None: ""}[row.holds]
            shown.add_row(f"  {row.what}", ours, other, row.software, f"{row.ratio:.3g}", spread, row.ratio_of, wanted)
        shown.add_section()
    return shown


def _three_digits(figure: float) -> str:
    return f"{figure:.3g}" if figure < 1000.0 else f"{figure:.0f}"


def write(path: Path, parts: Mapping[str, Findings], machine: Mapping[str, Any]) -> None:
    """Write the table and the results of all benchmarks as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [{"part": name, **row.plain()} for name, part in parts.items() for row in part.comparisons()]
    write_json(path, {"machine": machine, "rows": rows, "parts": {name: part.plain() for name, part in parts.items()}})


def alone(name: str, measure: Callable[[Console], Findings], out: Path) -> None:
    """Run one benchmark: print its remarks and rows, and write its file."""
    console, machine = Console(width=WIDTH), Machine.here()
    findings = measure(console)
    described = machine.plain()
    findings.show(console)
    console.print(table([findings], described))
    write(out, {name: findings}, described)
    console.print(f"Wrote {out}")
