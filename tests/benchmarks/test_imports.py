"""Imports are summed by package, and code that fails is no measurement."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.imports import ImportFindings, cpu, shares

SAID = """import time: self [us] | cumulative | imported package
import time:       250 |        250 |   numpy.linalg
import time:       500 |        750 | numpy
a warning | of | numpy
import time:      1000 |       1750 | mathnavi.sim
"""


def test_a_packages_modules_are_summed_the_longest_first() -> None:
    assert list(shares(SAID.splitlines()).items()) == [("mathnavi", 1e-3), ("numpy", pytest.approx(750e-6))]


def test_an_interpreter_takes_time_and_a_failure_is_no_measurement() -> None:
    taken, said = cpu("import json", "-X", "importtime")
    assert taken > 0.0
    assert "json" in shares(said.splitlines())
    with pytest.raises(RuntimeError, match="nonsense"):
        cpu("import nonsense")


def test_imports_are_compared_with_a_bare_interpreter() -> None:
    (row,) = ImportFindings(np.array([1.0]), np.array([0.1]), {}).comparisons()
    assert row.ratio == pytest.approx(10.0)
