"""Every kind of event that the loop and its planners name has a meaning, and is an alarm or routine."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import mathnavi
from mathnavi.interfaces.signals import Event
from mathnavi.sim.records.event_kinds import ALARMS, ROUTINE, event_definition, is_alarm

SOURCE = Path(mathnavi.__file__).parent
NAMED = re.compile(r"""(?:\bevent|\bEvent)\([^()"]*(?:\([^()]*\))?[^()"]*"([a-z]+(?:-[a-z]+)*)\"""")


def test_every_kind_that_is_named_in_the_source_has_a_meaning() -> None:
    found = {
        kind
        for part in ("sim/engine", "sim/scenarios", "controllers", "estimators")
        for file in (SOURCE / part).rglob("*.py")
        for kind in NAMED.findall(file.read_text(encoding="utf-8"))
    }
    assert len(found) > 8
    assert found - {"robot"} <= ALARMS.keys() | ROUTINE.keys()


@pytest.mark.parametrize("kind", sorted({**ALARMS, **ROUTINE}))
def test_a_meaning_is_a_sentence(kind: str) -> None:
    assert (kind in ALARMS) is not (kind in ROUTINE)
    text = event_definition(kind)
    assert text.endswith(".")
    assert text[0].isupper() or text.startswith("MuJoCo")


def test_a_message_is_no_alarm_and_a_lost_estimate_is_one() -> None:
    assert is_alarm(Event(0.0, "a", "guarantee-lost", ""))
    assert not is_alarm(Event(0.0, "a", "message", "agreed to arrive at 90 s"))
    assert is_alarm(Event(0.0, "a", "estimator-status", "lost: the estimate is not finite"))
    assert not is_alarm(Event(0.0, "a", "estimator-status", "ok: ok, after it was lost"))
    assert event_definition("of-a-stranger") == ""
