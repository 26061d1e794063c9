"""The user's choice of backend stands; without one OSMesa comes before EGL; what does not draw says why."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mathnavi.models import opengl


@pytest.fixture
def faults(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Faults of the backends on a machine that has them all; a test adds more."""
    found: dict[str, str] = {}
    monkeypatch.setattr(opengl, "_fault", lambda name: found.get(name, ""))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    return found


def test_the_users_choice_stands(faults: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    for chosen in ("glfw", "egl", "osmesa"):
        monkeypatch.setenv("MUJOCO_GL", chosen)
        assert opengl.available() == chosen
        assert opengl.environment()["MUJOCO_GL"] == chosen


def test_osmesa_comes_first_then_egl_then_nothing(faults: dict[str, str]) -> None:
    assert opengl.available() == "osmesa"
    faults["osmesa"] = "libOSMesa.so.8 is missing"
    assert opengl.available() == "egl"
    faults["egl"] = "EGL has no driver"
    assert opengl.available() is None
    with pytest.raises(opengl.NoOpenGLError, match=r"OSMesa.so.8 is missing; EGL has no driver.*libegl1 .*libosmesa6"):
        opengl.environment()


@pytest.mark.parametrize("value", opengl.SWITCHED_OFF)
def test_whoever_switched_drawing_off_is_not_told_to_install_anything(
    value: str, faults: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", value)
    assert opengl.available() is None
    with pytest.raises(opengl.NoOpenGLError, match=f"^MUJOCO_GL = {value} switches drawing off; allowed: .* unset"):
        opengl.environment()


@pytest.mark.parametrize(
    ("variables", "said"),
    [
        ({"MUJOCO_GL": "egl", "__EGL_VENDOR_LIBRARY_DIRS": os.devnull}, "; allowed: EGL with a driver .*libegl-mesa0"),
        ({"MUJOCO_GL": "egl", "MUJOCO_EGL_DEVICE_ID": "77"}, "MUJOCO_EGL_DEVICE_ID = 77; allowed: a whole number"),
        ({"MUJOCO_GL": "egl", "MUJOCO_EGL_DEVICE_ID": "one"}, "MUJOCO_EGL_DEVICE_ID = one; allowed: a whole number"),
        ({"MUJOCO_GL": "glfw"}, "there is no display, DISPLAY is not set; allowed: a desktop, or MUJOCO_GL=egl"),
        ({"MUJOCO_GL": "glfw", "DISPLAY": ":77"}, "the display ':77' cannot be opened; allowed: a desktop"),
        ({"MUJOCO_GL": "quantum"}, "MUJOCO_GL = quantum; allowed: osmesa, egl, glfw"),
    ],
)
def test_a_choice_that_cannot_draw_is_refused_in_one_line(
    variables: dict[str, str], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MUJOCO_GL", "egl")
    if "MUJOCO_EGL_DEVICE_ID" in variables and opengl.available() is None:
        pytest.skip("EGL makes no context here")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(opengl.NoOpenGLError, match=said) as refused:
        opengl.opengl_context(8, 8)
    assert len(str(refused.value).splitlines()) == 1


def test_a_trial_that_dies_is_a_fault(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    probe = tmp_path / "probe.py"
    probe.write_text("import os; os.abort()")
    monkeypatch.setattr(opengl, "PROBE", probe)
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setenv("A", str(tmp_path))  # so that it is tried anew
    with pytest.raises(opengl.NoOpenGLError, match="MUJOCO_GL = egl: trying it ended with exit code -6; allowed"):
        opengl.backend()


def test_child_gets_the_backend_and_not_pyopengls_own_choice(
    faults: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")  # as dm_control leaves it behind
    environment = opengl.environment()
    assert environment["MUJOCO_GL"] == "osmesa"
    assert "PYOPENGL_PLATFORM" not in environment


@pytest.mark.parametrize("chosen", opengl.PREFERRED)
def test_what_the_trial_accepts_mujoco_draws_with(chosen: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", chosen)
    if opengl.available() is None:
        pytest.skip(f"{chosen} makes no context here")
    script = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8).close()"
    subprocess.run([sys.executable, "-c", script], env=opengl.environment(), check=True)
