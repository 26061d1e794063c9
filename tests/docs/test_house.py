"""The picture of the sources is what the program draws from them, and no modules import each other in a circle."""

from __future__ import annotations

from tests.programs import program

draw_house = program("docs/draw_house.py")


def test_no_modules_import_each_other_in_a_circle_and_the_committed_picture_is_the_present_one() -> None:
    arrows, loops = draw_house.house()
    assert loops == []
    committed = draw_house.PICTURE.read_text(encoding="utf-8")
    assert committed == draw_house.drawn(arrows, loops), "python docs/draw_house.py"


def test_circles_are_found() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set(), "e": {"d"}}
    assert draw_house.circles(graph) == [["a", "b", "c"]]
    assert draw_house.reduced({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == {"a": {"b"}, "b": {"c"}, "c": set()}
