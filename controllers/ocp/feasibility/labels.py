"""Names of the rows and bounds of a programme, as a message about constraints shows them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mathnavi.controllers.ocp.layout import bounded_states
from mathnavi.controllers.ocp.nlp import Programme
from mathnavi.interfaces.signals import Array, Integers


def row_labels(nlp: Programme) -> list[str]:
    """A label (m,) for every row; empty for those of the nodes and of constants."""
    problem, layout = nlp.layout.problem, nlp.layout
    labels = [""] * len(nlp.lower)
    nd, dynamics = len(problem.path_bounds.lower), [f"dynamics of {name}" for name in problem.states]
    path = [f"path: {text}" for text in limited(problem.path_names, *problem.path_bounds)]
    limits = limited(problem.states, *problem.state_bounds)
    between = [limits[i] for i in bounded_states(problem)]
    hidden = max(0, len(layout.scheme.points) - 2) if layout.scheme.interior == 0 else 0
    along = path * layout.own_points + between * hidden

    def label(rows: Integers, names: Sequence[str]) -> None:
        for row, name in zip(rows.tolist(), names, strict=False):
            if row >= 0:
                labels[row] = name

    for start, inner, held in zip(nlp.gap_start, nlp.inner_rows, nlp.held_rows, strict=True):
        label(start + np.arange(problem.nx), dynamics)
        label(inner, dynamics * layout.scheme.interior)
        label(held, along)
    label(nlp.initial_rows, with_place("start", limited(problem.initial_names, *problem.initial_bounds)))
    ends = with_place("end", limited(problem.final_names, *problem.final_bounds))
    label(nlp.final_rows, ends + (path if len(nlp.final_rows) == len(ends) + nd else []))
    if problem.instants is not None:
        label(nlp.instant_rows, limited(problem.instants.names, *problem.instants.bounds))
    return labels


def bound_labels(nlp: Programme, multipliers: Array) -> list[str]:
    """Label (n,) of the bound of every unknown, on the side that its multiplier (n,) belongs to."""
    problem, layout = nlp.layout.problem, nlp.layout
    upper = multipliers > 0.0
    names = np.full((2, layout.size), "", dtype=object)
    for side, sign in enumerate((">=", "<=")):
        controls = _texts(problem.controls, sign, problem.control_bounds[side])
        states = _texts(problem.states, sign, problem.state_bounds[side])
        z = states + _texts(("T",) * layout.durations, sign, np.full(layout.durations, problem.duration_bounds[side]))
        z += [""] * (layout.state_size - len(z))
        w = controls * layout.own_points + states * layout.scheme.interior
        w += [""] * (layout.input_size - len(w))
        own = np.tile(np.array(z + w, dtype=object), (layout.nodes - 1, 1))[layout.stage_columns >= 0]
        names[side] = [*own, *z, *(controls if layout.scheme.shared else [])]
    return [str(names[int(above), i]) for i, above in enumerate(upper)]


def _texts(names: Sequence[str], sign: str, limits: Array) -> list[str]:
    return [f"{name} {sign} {limit:g}" for name, limit in zip(names, limits, strict=True)]


def with_place(where: str, texts: Sequence[str]) -> list[str]:
    """Texts of constraints with the end at which they hold, "start" or "end"."""
    return [text if text.startswith(f"{where} of ") else f"{where}: {text}" for text in texts]


def limited(names: Sequence[str], lower: Array, upper: Array) -> list[str]:
    """Names of constraints, with their limits unless the text contains them."""
    texts = []
    for name, least, most in zip(names, lower, upper, strict=True):
        if any(sign in name for sign in ("=", "<", ">", " of ")):  # with its limits, or the pinned end of a state
            texts.append(name)
        elif least == most:
            texts.append(f"{name} = {least:g}")
        else:
            below, above = "" if least == -np.inf else f"{least:g} <= ", "" if most == np.inf else f" <= {most:g}"
            texts.append(f"{below}{name}{above}")
    return texts
