"""Published problems: every one of four collections by plain ``solve()``, one process for each.

The lists (``library.PUBLISHED``: PSOPT, COPS 3, Bocop, OptimalControlProblems.jl with the dymos examples behind it)
name every problem of their sources, with the optimum as printed. A problem that several sources have is solved
once. Each is solved by ``solve()`` without an argument, in its own process on one core (``solving``).

**Measured**: the status; J, as a value of the quantity that the source prints; the significant digit in which it first
differs from the print; its relative error against the optimum by an independent transcription or in closed form; the
miss of the control that is flown from the start to the end in one piece; nodes; and CPU seconds of statement and
``solve()``.

**Solved** is a problem whose status is OPTIMAL and whose J is within 1e-6 of the independent value, relative to its
distance from the origin, and within 1e-5 where the optimum has a singular arc. **A lie** is OPTIMAL with another J, or
INFEASIBLE where an independent optimum is known. All else is unsolved: a problem that cannot be stated, another status,
an exception, a crash, 120 s of CPU time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from annotated_types import Interval
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import configuration
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.studies.framework.drawing import BAD, GOOD
from mathnavi.studies.framework.study import Row, Setup, StudyResult
from mathnavi.studies.published.charts import Line, Mark, Panel, chart
from mathnavi.studies.published.library import (
    COLLECTION,
    DISTINCT,
    EVERY,
    PUBLISHED,
    STATED_AS,
    is_singular,
    known_cost,
    precision,
    relative_error,
)
from mathnavi.studies.published.optimum import PublishedOptimum
from mathnavi.studies.published.printed import first_difference
from mathnavi.studies.published.solving import SECONDS, Attempt, attempted, no_figures

Verdict = Literal["solved", "unsolved", "lie"]
FEWEST, SHARE, WITHIN = 80, 0.95, 30.0  # problems, share of them solved, [s] of CPU time: the claim
NOT_STATED = "not stated"
INFEASIBLE = "infeasible"
MARKS = {
    "solved": Mark(GOOD, "o", "solved"),
    "solved, singular": Mark(GOOD, "D", "solved, with a singular arc: dashed limit"),
    "unsolved": Mark("#8a6d1c", "o", "unsolved, or without an independent value"),
    "lie": Mark(BAD, "X", "lie: OPTIMAL, and not so"),
}
SMALLEST_ERROR = 1e-12


@configuration
class OcpOutsideConfig:
    """Sample sizes: problems that are solved."""

    problems: Annotated[int, Interval(ge=1, le=len(DISTINCT))] = len(DISTINCT)
    """number of distinct problems, in the order of the lists"""


class OcpOutside:
    """Every problem of four published collections, by plain ``solve()``."""

    Config = OcpOutsideConfig
    quick = OcpOutsideConfig(problems=4)
    title = "Published optimal control problems"
    on_terrain = False

    @staticmethod
    def run(config: OcpOutsideConfig, setup: Setup) -> StudyResult:
        chosen = DISTINCT[: config.problems]
        stated = [name for name in chosen if EVERY[name].statement is not None]
        found = dict(zip(stated, setup.compute(attempted, [Attempt(name) for name in stated]), strict=True))
        rows = [row(name, found.get(STATED_AS[name])) for name in PUBLISHED if STATED_AS[name] in chosen]
        once = distinct(rows)
        return StudyResult(
            summary=(
                f"{len(rows)} entries of published collections, {len(once)} distinct problems, each by solve() without "
                f"an argument in a process of its own on one core, ended after {SECONDS} s of CPU time. Solved: "
                "OPTIMAL, and J within 1e-6 of an independent value (1e-5 with a singular arc). A lie: OPTIMAL with "
                "another J, or INFEASIBLE where an optimum is known.",
                "J is a value of the quantity that the source prints. Its digit is the first significant one in which "
                "ours, rounded, is not the print; beside it that of the independent value, which says which of the two "
                "is right. The miss is that of the control flown from start to end in one piece.",
            ),
            rows=rows,
            tables=(table(rows),),
            figure=figure(once),
            caption="Relative error of J against the independent value, with its limits 1e-6 and, with a singular arc, "
            "1e-5; and CPU seconds with the limit of 30 s. A problem without a point has no error: its status is "
            "written in its place.",
            claims=(claim(once),),
        )


def row(name: str, found: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the figures of an entry of the lists; ``found`` is None for a problem that is not stated."""
    entry, optimum = EVERY[name], known_cost(name)
    figures = found or {**no_figures(), "status": NOT_STATED, "message": entry.note, "cpu_s": math.nan}
    value = entry.sign * figures["cost"]
    independent = math.nan if optimum is None else entry.sign * optimum
    error = relative_error(entry, value, independent)
    return {
        "problem": name,
        "stated_as": STATED_AS[name],
        "source": entry.source,
        "quantity": entry.quantity,
        "singular": is_singular(name),
        "status": figures["status"],
        "verdict": verdict(figures["status"], error, precision(name), known=optimum is not None),
        "value": value,
        "value_replayed": entry.sign * figures["cost_replayed"],
        "published": entry.value,
        "differs_in_digit": _digit(entry, value),
        "independent": independent,
        "independent_differs_in_digit": _digit(entry, independent),
        "evidence": entry.evidence or EVERY[STATED_AS[name]].evidence,
        "error": error,
        "tolerance": precision(name),
        "miss": figures["miss"],
        "miss_by_intervals": figures["miss_by_intervals"],
        "path_violation": figures["path_violation"],
        "cost_error": figures["cost_error"],
        "nodes": figures["nodes"],
        "iterations": figures["iterations"],
        "cpu_s": MeasuredTime(figures["cpu_s"]),
        "message": figures["message"],
        "note": entry.note,
    }


def verdict(status: str, error: float, within: float, *, known: bool) -> Verdict:
    """Return whether a problem is solved, from its status and the relative error of J.

    ``known`` says whether an independent optimum exists: without one nothing is solved, and nothing is a lie.
    """
    if not known:
        return "unsolved"
    if status == "optimal":
        return "solved" if error <= within else "lie"
    return "lie" if status == INFEASIBLE else "unsolved"


def distinct(rows: Sequence[Row]) -> list[Row]:
    """Return one row of each problem: that of the first entry that the lists have of it."""
    first: dict[str, Row] = {}
    for each in rows:
        first.setdefault(each["stated_as"], each)
    return list(first.values())


def _digit(entry: PublishedOptimum, value: float) -> int | str:
    """Return the digit in which a value first differs from the print; "" where one of them is missing or they agree."""
    if not entry.value or math.isnan(value):
        return ""
    return first_difference(entry.value, value) or ""


def claim(rows: Sequence[Row]) -> Claim:
    """Evaluate the claim on the distinct problems."""
    lies = [each["problem"] for each in rows if each["verdict"] == "lie"]
    missed = [each["problem"] for each in rows if each["verdict"] == "unsolved"]
    slow = [
        f"{each['problem']} {each['cpu_s']:.0f} s" for each in rows if each["verdict"] == "solved" and _is_slow(each)
    ]
    solved = len(rows) - len(lies) - len(missed) - len(slow)
    told = [f"{solved} of {len(rows)} solved within {WITHIN:g} s, {len(lies)} lies"]
    told += [
        f"{what}: {', '.join(names)}" for what, names in (("lies", lies), ("unsolved", missed), ("slow", slow)) if names
    ]
    whole = len(rows) >= max(FEWEST, len(DISTINCT))
    reached = not lies and solved >= SHARE * len(rows)
    return Claim(
        "ocp.outside", "target",
        "solve() finds the optima of every problem of four published collections, and calls nothing else optimal.",
        "1.1",
        f"of at least {FEWEST} problems {SHARE:.0%} OPTIMAL with J to 1e-6 of an independent value, 1e-5 with a "
        f"singular arc, each within {WITHIN:g} s of CPU time on one core, and no lie",
        "; ".join(told),
        reached if whole else None if reached else False,
    )  # fmt: skip


def _is_slow(each: Row) -> bool:
    return bool(each["cpu_s"] > WITHIN)


def table(rows: Sequence[Row]) -> Table:
    """Return the table with a row for each entry of the lists."""
    return Table.of(
        "Published problems by solve(), nothing chosen; * replayed by intervals, not in one piece", rows, (
            ("problem", "problem"), ("quantity", "quantity"), ("status", lambda row: row["status"].replace("_", " ")),
            ("verdict", "verdict"), ("ours", lambda row: _number(row["value"], ".7g")),
            ("published", "published"), ("digit", lambda row: str(row["differs_in_digit"])),
            ("independent", lambda row: _number(row["independent"], ".10g")),
            ("its digit", lambda row: str(row["independent_differs_in_digit"])),
            ("error", lambda row: _number(row["error"], ".0e")),
            ("miss", lambda row: _number(row["miss"], ".0e") or _number(row["miss_by_intervals"], ".0e *")),
            ("N", lambda row: str(row["nodes"] or "")), ("CPU", lambda row: _number(row["cpu_s"], ".1f", " s")),
            ("solved as", lambda row: "" if row["stated_as"] == row["problem"] else row["stated_as"]),
        ),
    )  # fmt: skip


def _number(value: float, form: str, unit: str = "") -> str:
    """Return a number as text; "" for NaN."""
    form, mark, _ = form.partition(" *")
    return "" if math.isnan(value) else f"{value:{form}}{mark}{unit}"


def figure(rows: Sequence[Row]) -> Figure:
    """Draw errors and CPU times of the distinct problems."""
    lines = [_line(each) for each in rows]
    panels = (
        Panel("relative error of J", {1e-6: "-", 1e-5: "--"}, (SMALLEST_ERROR, 1.0)),
        Panel("CPU [s]", {WITHIN: "-"}, (0.03, float(SECONDS))),
    )
    return chart("Published problems by plain solve(), one process and one core each", lines, panels, MARKS)


def _line(each: Row) -> Line:
    known = each["verdict"] != "unsolved" or each["status"] in ("converged", "stationary")
    mark = "solved, singular" if each["verdict"] == "solved" and each["singular"] else each["verdict"]
    missing = "no independent value" if math.isnan(each["independent"]) else ""
    text = each["status"].replace("_", " ")
    values = (each["error"] if known else math.nan, each["cpu_s"])
    return Line(each["problem"].removeprefix(COLLECTION), values, mark, f"{text}, {missing}" if missing else text)
