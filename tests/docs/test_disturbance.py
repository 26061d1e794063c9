"""The entry that docs/how-to/disturbance.md adds to fault_fields.py makes its wind a field of every flight."""

from __future__ import annotations

import re
import sys
import types

import pytest

from mathnavi.interfaces.errors import FieldError
from tests.docs.test_blocks import ROOT

PAGE = (ROOT / "docs" / "how-to" / "disturbance.md").read_text(encoding="utf-8")
SOURCE = (ROOT / "sim" / "scenarios" / "fault_fields.py").read_text(encoding="utf-8")
GROUPS = "# ---- groups of them\n"


def side(diff: str, other: str) -> str:
    """One side of a diff: its lines without those that begin with the sign of the other side."""
    return "".join(f"{line[1:]}\n" for line in diff.splitlines() if not line.startswith(other))


def test_the_entry_makes_the_wind_a_field_of_every_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    (wind,) = re.findall(r"^```python\n# wind\.py\n(@configuration.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert SOURCE.count(GROUPS) == 1
    source = SOURCE.replace(GROUPS, f"{wind}\n\n{GROUPS}")
    for diff in re.findall(r"^```diff\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE):
        before, after = side(diff, "+"), side(diff, "-")
        assert source.count(before) == 1, before
        source = source.replace(before, after)
    module = types.ModuleType("fault_fields_with_wind")
    monkeypatch.setitem(sys.modules, module.__name__, module)  # where the types of fields are looked up
    exec(compile(source, "fault_fields.py with docs/how-to/disturbance.md", "exec"), module.__dict__)
    for group in (module.CommonFlightFaults, module.AerialFaults):
        kinds = [kind.__name__ for kind in module.kinds(group(constant_wind=(0.5, 0.0, 0.0)))]
        assert kinds[:3] == ["SolverFailures", "LatePlans", "ConstantWind"]
        with pytest.raises(
            FieldError, match=r"^faults\.constant_wind = .*; allowed: three finite numbers, none beyond"
        ):
            group(constant_wind=(0.5, float("inf"), 0.0))
