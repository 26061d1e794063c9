"""The status of a solve that failed, from what is proved of its problem."""

from __future__ import annotations

import dataclasses

from mathnavi.controllers.ocp.feasibility.enclosure import infeasible_by_enclosure
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome


def proved(failed: Solution, *, named: bool) -> Solution:
    """A failed solution, INFEASIBLE with the reason if enclosures prove it of its problem and parameters.

    A message in which constraints are ``named`` already, by the elastic programme, is continued.
    """
    proof = infeasible_by_enclosure(failed.problem, failed.parameters)
    if proof is None:
        return failed
    message = f"{failed.message}; from the start {proof.reached}" if named and proof.reached else str(proof)
    return dataclasses.replace(failed, status=SolverOutcome.INFEASIBLE, message=message)
