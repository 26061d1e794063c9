"""MJCF files that would take memory or time without end are refused before MuJoCo reads them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.reading import mechanisms
from mathnavi.interfaces.reading.mechanisms import read_spec

ARM = '<mujoco>{}<worldbody><body><joint axis="0 1 0"/><geom size="0.1"/></body></worldbody></mujoco>'


@pytest.mark.refused("MJCF", "document type, entities")
@pytest.mark.refused("MJCF", "asset hfield, texture beyond 25 million elements")
@pytest.mark.refused("MJCF", "numbers that are not finite")
@pytest.mark.refused("MJCF", "unknown elements, no XML")
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<!DOCTYPE a [<!ENTITY b "c">]>' + ARM.format(""), "document type or entities"),
        (ARM.format('<asset><hfield name="h" nrow="99999" ncol="99999" size="1 1 1 1"/></asset>'), "nrow x ncol are"),
        (
            ARM.format('<asset><texture type="2d" builtin="flat" width="99999" height="99999"/></asset>'),
            "height x width",
        ),
        (ARM.format("").replace("0 1 0", "nan 0 1"), 'axis="nan 0 1"; allowed: finite numbers'),
        (ARM.format("<nothing/>"), "MuJoCo cannot read it"),
        ("", "MuJoCo cannot read it"),
    ],
)
def test_a_file_that_is_no_mechanism_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(text)
    with pytest.raises(FieldError, match=message) as refused:
        read_spec(path, FieldError)
    assert str(path) in str(refused.value)


@pytest.mark.refused("MJCF", "more than 16 MiB")
def test_a_file_that_is_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(""))
    assert read_spec(path, FieldError).compile().njnt == 1
    monkeypatch.setattr(mechanisms, "MOST_MJCF", 10)
    with pytest.raises(FieldError, match="bytes; allowed: at most 10"):
        read_spec(path, FieldError)


@pytest.mark.refused("MJCF", "pipes and devices as files")
@pytest.mark.parametrize("element", ['<include file="pipe"/>', '<asset><mesh name="m" file="pipe"/></asset>'])
def test_nobody_is_waited_for(tmp_path: Path, element: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "arm.xml").write_text(ARM.format(element))
    with pytest.raises(FieldError, match="a regular file"):
        read_spec(tmp_path / "arm.xml", FieldError)


@pytest.mark.refused("MJCF", "include in a circle")
@pytest.mark.refused("MJCF", "numbers that are not finite")
def test_what_is_included_is_checked(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format('<include file="more.xml"/>'))
    (tmp_path / "more.xml").write_text('<mujoco><option timestep="nan"/><include file="arm.xml"/></mujoco>')
    with pytest.raises(FieldError, match="timestep"):
        read_spec(tmp_path / "arm.xml", FieldError)
    (tmp_path / "more.xml").write_text('<mujoco><include file="arm.xml"/></mujoco>')
    with pytest.raises(FieldError, match=r"'more\.xml' already included"):
        read_spec(tmp_path / "arm.xml", FieldError)
