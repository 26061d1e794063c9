"""What a run says about contacts: what is touched, and what to write where that is normal operation."""

from __future__ import annotations

import pytest

from mathnavi.interfaces.signals import Event
from mathnavi.sim.engine.contact_messages import declaration, declaration_at_start, thing_named, touching


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["floor"], 'VehicleSetup(..., ignored_contacts=("floor",))'),
        (["floor", "ramp"], 'VehicleSetup(..., ignored_contacts=("floor", "ramp"))'),
        (["geom 4"], 'VehicleSetup(..., ignored_contacts=("NAME",)), with name="NAME" for geom 4 of the model'),
    ],
)  # fmt: skip
def test_the_line_to_write_has_the_geoms_by_name(names: list[str], said: str) -> None:
    assert declaration(names) == said


@pytest.mark.parametrize("where", [(), (1.0, 2.0)])
@pytest.mark.parametrize("name", ["floor", ""])
def test_a_run_that_ends_where_it_stands_says_what_to_write(name: str, where: tuple[float, ...]) -> None:
    thing = thing_named(name, 7)
    contact = Event(0.02, "rover", "ground-contact", touching(thing, where, 0.1))
    said = declaration_at_start([Event(0.0, "rover", "input-clipped", "touches nothing"), contact], 0.02)
    assert said.startswith(f"rover touches {thing} from the start: ")
    assert said.endswith(declaration([thing]))


def test_a_run_that_hits_something_on_its_way_is_told_nothing() -> None:
    contact = Event(0.9, "rover", "contact", touching("wall", (), 0.0))
    assert declaration_at_start([contact], 0.9)
    assert declaration_at_start([contact], 1.0) == ""
    assert declaration_at_start([Event(0.1, "rover", "vehicle-contact", "touches other")], 0.1) == ""
