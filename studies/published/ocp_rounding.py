"""Whether last digits decide: each problem from guesses that differ by rounding, and on machines that round otherwise.

Every problem of the collection and of the published lists is solved by plain ``solve()`` as stated; with its
guess perturbed by 1e-12 of the scale of each variable, several draws; and under other settings of libm and BLAS, which
round as other processors do. Each solve has its own process (``solving``).

A problem is settled if all of them end with the same status and, where that status has a solution, in the same J: the
spread of J, largest minus least, is within 1e-6 of its distance from the origin, 1e-5 with a singular arc. A problem
that is not solved within the limit of CPU time as stated is not settled, and is not solved again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from annotated_types import Interval
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import configuration
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import BAD, GOOD
from mathnavi.studies.framework.study import Row, Setup, StudyResult
from mathnavi.studies.published.charts import Line, Mark, Panel, chart
from mathnavi.studies.published.library import COLLECTION, DISTINCT, EVERY, OF_THE_COLLECTION, known_cost, precision
from mathnavi.studies.published.solving import AS_IT_IS, PERTURBATION, SETTINGS, TIMED_OUT, Attempt, attempted

STATED = tuple(name for name in dict.fromkeys((*OF_THE_COLLECTION, *DISTINCT)) if EVERY[name].statement is not None)
"""names of the entries that state a problem, those of the collection first"""
DRAWS = 5
MARKS = {
    "settled": Mark(GOOD, "o", "one status, J within the tolerance"),
    "spread": Mark("#d9822b", "D", "one status, J apart"),
    "statuses": Mark(BAD, "X", "several statuses"),
}


@configuration
class OcpRoundingConfig:
    """Sample sizes: problems that are solved, and how often."""

    problems: Annotated[int, Interval(ge=1, le=len(STATED))] = len(STATED)
    """number of problems, those of the collection first"""
    draws: Annotated[int, Interval(ge=1, le=100)] = DRAWS
    """number of guesses that differ by rounding"""
    settings: Annotated[int, Interval(ge=1, le=len(SETTINGS))] = len(SETTINGS)
    """number of settings of libm and BLAS, the machine's own first"""


class OcpRounding:
    """Every problem again, from guesses and on machines that differ in last digits."""

    Config = OcpRoundingConfig
    quick = OcpRoundingConfig(problems=4, draws=1, settings=2)
    title = "Whether last digits decide"
    on_terrain = False

    @staticmethod
    def run(config: OcpRoundingConfig, setup: Setup) -> StudyResult:
        names = STATED[: config.problems]
        settings = list(SETTINGS)[: config.settings]
        found = _made(setup, [Attempt(name) for name in names])
        others = {each.problem: _others(each.problem, config.draws, settings) for each in found if _ended(found[each])}
        found |= _made(setup, [each for own in others.values() for each in own])
        rows = [row(name, {each: found[each] for each in (Attempt(name), *others.get(name, ()))}) for name in names]
        return StudyResult(
            summary=(
                f"{len(rows)} problems by solve() without an argument, each {1 + config.draws + len(settings) - 1} "
                f"times: as it is stated, from {config.draws} guesses perturbed by {PERTURBATION:g} of the scales, and "
                f"under {len(settings) - 1} other settings of libm and BLAS.",
                "The spread is the largest J minus the least, relative to the distance of the optimum from its origin.",
            ),
            rows=rows,
            tables=(table(rows),),
            figure=figure(rows),
            caption="Spread of J over the tolerance of the problem; the statuses are written where there are several.",
            claims=(claim(rows, config),),
        )


def _made(setup: Setup, attempts: Sequence[Attempt]) -> dict[Attempt, dict[str, Any]]:
    """Return the figures of attempts."""
    return dict(zip(attempts, setup.compute(attempted, attempts), strict=True))


def _ended(figures: Mapping[str, Any]) -> bool:
    """Return whether an attempt ended by itself."""
    return bool(figures["status"] != TIMED_OUT)


def _others(name: str, draws: int, settings: Sequence[str]) -> list[Attempt]:
    """Return the attempts of a problem after that which is as stated."""
    rounded = [Attempt(name, setting=setting) for setting in settings if setting != AS_IT_IS]
    return [*(Attempt(name, draw) for draw in range(draws)), *rounded]


def row(name: str, found: Mapping[Attempt, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the statuses of a problem and the spread of its J."""
    entry = EVERY[name]
    statuses = [figures["status"] for figures in found.values()]
    values = [entry.sign * figures["cost"] for figures in found.values()]
    optimum = known_cost(name)
    middle = values[0] if optimum is None else entry.sign * optimum
    distance = abs(middle - entry.origin) or 1.0
    known = [figures["solved"] for figures in found.values()]
    spread = math.nan if not all(known) else (max(values) - min(values)) / distance
    one = len(set(statuses)) == 1
    return {
        "problem": name,
        "statuses": " ".join(dict.fromkeys(statuses)),
        "spread": spread,
        "tolerance": precision(name),
        "settled": one and all(map(_ended, found.values())) and (not any(known) or spread <= precision(name)),
        "one_status": one,
        "value": values[0],
        **{f"status, {_word(each)}": figures["status"] for each, figures in found.items()},
        **{f"J, {_word(each)}": entry.sign * figures["cost"] for each, figures in found.items()},
    }


def _word(attempt: Attempt) -> str:
    """Return what distinguishes an attempt, in a word or two."""
    return attempt.setting if attempt.draw is None else f"draw {attempt.draw}"


def claim(rows: Sequence[Row], config: OcpRoundingConfig) -> Claim:
    """Evaluate the claim that no last digit decides."""
    moved = [f"{each['problem']} ({_found(each)})" for each in rows if not each["settled"]]
    whole = len(rows) == len(STATED) and config.draws >= DRAWS and config.settings == len(SETTINGS)
    return Claim(
        "ocp.rounding", "target",
        "No last digit decides: the same problem ends with the same status and J, whatever its guess and the machine "
        "round to.", "1.1",
        f"each problem of the collection and of the published lists from {DRAWS} guesses perturbed by "
        f"{PERTURBATION:g} and under {len(SETTINGS) - 1} other settings of libm and BLAS: one status, J to 1e-6, 1e-5 "
        "with a singular arc",
        f"{len(rows) - len(moved)} of {len(rows)}" + (f"; not {', '.join(moved)}" if moved else ""),
        False if moved else True if whole else None,
    )  # fmt: skip


def _found(each: Row) -> str:
    return f"{each['spread']:.0e}" if each["one_status"] else each["statuses"].replace(" ", ", ")


def table(rows: Sequence[Row]) -> Table:
    """Return the table with a row for each problem."""
    return Table.of("Statuses and J of the same problem, rounded otherwise", rows, (
        ("problem", "problem"), ("statuses", lambda row: row["statuses"].replace("_", " ")),
        ("J", "{value:.9g}"), ("spread of J", lambda row: "" if math.isnan(row["spread"]) else f"{row['spread']:.0e}"),
        ("allowed", "{tolerance:.0e}"), ("settled", lambda row: "yes" if row["settled"] else "no"),
    ))  # fmt: skip


def figure(rows: Sequence[Row]) -> Figure:
    """Draw the spread of every problem over its tolerance."""
    lines = [
        Line(
            each["problem"].removeprefix(COLLECTION),
            (each["spread"] / each["tolerance"],),
            "settled" if each["settled"] else "spread" if each["one_status"] else "statuses",
            each["statuses"].replace("_", " "),
        )
        for each in rows
    ]
    panel = Panel("spread of J over its tolerance", {1.0: "-"}, (1e-9, 1e6))
    return chart("The same problems, rounded otherwise", lines, (panel,), MARKS)
