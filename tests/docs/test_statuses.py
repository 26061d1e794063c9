"""The page on statuses of optimal control has each of them, with tests that exist."""

from __future__ import annotations

import re

import pytest

from mathnavi.models.nlp_solver import SolverOutcome
from tests.docs.test_site import DOCS

PAGE = (DOCS / "reference" / "optimal-control-statuses.md").read_text(encoding="utf-8")
TESTS = DOCS.parent / "tests" / "controllers" / "ocp"


@pytest.mark.parametrize("status", SolverOutcome)
def test_a_status_has_its_row_and_its_tests(status: SolverOutcome) -> None:
    (row,) = (line for line in PAGE.splitlines() if line.startswith(f"| `{status.name}` |"))
    named = re.findall(r"`([\w/]+\.py)::(test_\w+)`", row)
    assert named
    for file, test in named:
        assert f"\ndef {test}(" in (TESTS / file).read_text(encoding="utf-8"), f"{file}::{test}"
