"""The user's choice of backend stands; without one OSMesa comes before EGL."""

from __future__ import annotations

import pytest

from mathnavi.models import opengl


def test_users_choice_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    assert opengl.available() == "glfw"
    assert opengl.environment()["MUJOCO_GL"] == "glfw"


def test_osmesa_comes_first_then_egl_then_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    installed = {"OSMesa", "EGL", "OpenGL", "GL"}
    monkeypatch.setattr(opengl, "_loads", lambda soname, name: name in installed)
    assert opengl.available() == "osmesa"
    installed.remove("OSMesa")
    assert opengl.available() == "egl"
    installed.remove("OpenGL")
    assert opengl.available() == "egl"
    installed.remove("GL")  # EGL alone makes a context, and nothing to draw with in it
    assert opengl.available() is None
    with pytest.raises(opengl.NoOpenGLError, match="libosmesa6"):
        opengl.environment()


def test_rendering_can_be_switched_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")
    assert opengl.available() is None


def test_child_gets_the_backend_and_not_pyopengls_own_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")  # as dm_control leaves it behind
    environment = opengl.environment()
    assert environment["MUJOCO_GL"] == "osmesa"
    assert "PYOPENGL_PLATFORM" not in environment


def test_a_backend_that_is_unknown_is_refused_and_not_replaced_by_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "quantum")
    with pytest.raises(opengl.NoOpenGLError, match="MUJOCO_GL = quantum; allowed: osmesa, egl, glfw"):
        opengl.opengl_context(8, 8)
