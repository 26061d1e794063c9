"""Trial of a backend of OpenGL, in its own process: ``python -I -S opengl_probe.py BACKEND [PATH ...]``.

It does what MuJoCo does to make a context. If that works, it prints "software" or "hardware", what would draw;
otherwise it prints why not, in a line, and in a second one what is allowed if that is not the backend installed, and
ends with exit code 1. A library that loads is not enough: EGL's finds no driver where none is installed, and a window
needs a display.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
from collections.abc import Callable, Iterable
from typing import Any

SOFTWARE, HARDWARE = "software", "hardware"
MOST_DEVICES = 10  # of EGL, as MuJoCo has it
DEVICE_NUMBER = "MUJOCO_EGL_DEVICE_ID"  # the environment variable that chooses one
SUCCESS = 0x3000
EXTENSIONS = 0x3055
PLATFORM_DEVICE = 0x313F  # EGL_EXT_platform_device
OPENGL_API = 0x30A2
# What MuJoCo asks for: 8 bits of each of red, green, blue, alpha, 24 of depth, 8 of stencil; RGB, off screen, OpenGL.
WANTED = (
    *(0x3024, 8, 0x3023, 8, 0x3022, 8, 0x3021, 8, 0x3025, 24, 0x3026, 8),
    *(0x303F, 0x308E, 0x3033, 0x0001, 0x3040, 0x0008, 0x3038),
)


class FaultError(Exception):
    """Reason why a backend does not draw."""


def try_osmesa() -> str:
    """Load OSMesa, which always draws by software."""
    if _loaded(("libOSMesa.so.8", "OSMesa")) is None:
        raise FaultError("libOSMesa.so.8 is missing")
    return SOFTWARE


def try_egl() -> str:
    """Make a context without a screen by the first of EGL's devices that can; return what draws there."""
    egl = _loaded(("libEGL.so.1", "EGL"))
    if egl is None:
        raise FaultError("libEGL.so.1 is missing")
    if _loaded(("libOpenGL.so.0", "OpenGL"), ("libGL.so.1", "GL")) is None:
        raise FaultError("libOpenGL.so.0 is missing")  # EGL alone makes a context, and nothing to draw with in it
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    names = (b"eglQueryDevicesEXT", b"eglGetPlatformDisplayEXT", b"eglQueryDeviceStringEXT")
    addresses = [egl.eglGetProcAddress(name) for name in names]
    if not all(addresses):
        raise FaultError("EGL has no driver")
    pointer, integer = ctypes.c_void_p, ctypes.c_int
    query = ctypes.CFUNCTYPE(integer, integer, pointer, pointer)(addresses[0])
    display_of = ctypes.CFUNCTYPE(pointer, integer, pointer, pointer)(addresses[1])
    extensions_of = ctypes.CFUNCTYPE(ctypes.c_char_p, pointer, integer)(addresses[2])
    devices, count = (pointer * MOST_DEVICES)(), integer()
    query(MOST_DEVICES, devices, ctypes.byref(count))
    if not count.value:
        raise FaultError("EGL has no driver")
    chosen = os.environ.get(DEVICE_NUMBER)
    if chosen is not None and not (chosen.strip().isdecimal() and int(chosen) < count.value):
        raise FaultError(f"{DEVICE_NUMBER} = {chosen}\nallowed: a whole number from 0 to {count.value - 1}, or unset")
    candidates = devices[: count.value] if chosen is None else [devices[int(chosen)]]
    for device in candidates:
        if _makes_context(egl, display_of(PLATFORM_DEVICE, device, None)):
            return SOFTWARE if b"software" in (extensions_of(device, EXTENSIONS) or b"") else HARDWARE
    raise FaultError("no driver of EGL makes a context without a screen")


def _makes_context(egl: Any, display: int | None) -> bool:
    """True if OpenGL can be used on a display, in the format that MuJoCo wants."""
    pointer = ctypes.c_void_p
    egl.eglInitialize.argtypes = [pointer] * 3
    if not display or egl.eglGetError() != SUCCESS or not egl.eglInitialize(display, None, None):
        return False
    egl.eglChooseConfig.argtypes = [pointer, pointer, pointer, ctypes.c_int, pointer]
    egl.eglCreateContext.argtypes, egl.eglCreateContext.restype = [pointer] * 4, pointer
    egl.eglMakeCurrent.argtypes = [pointer] * 4
    config, count = pointer(), ctypes.c_int()
    wanted = (ctypes.c_int * len(WANTED))(*WANTED)
    egl.eglChooseConfig(display, wanted, ctypes.byref(config), 1, ctypes.byref(count))
    if not count.value or not egl.eglBindAPI(OPENGL_API):
        return False
    context = egl.eglCreateContext(display, config, None, None)
    return bool(context and egl.eglMakeCurrent(display, None, None, context))


def try_glfw() -> str:
    """Open a window, which is never shown; what draws in it is not asked for."""
    names = ("DISPLAY", "WAYLAND_DISPLAY")
    where = next((os.environ[name] for name in names if os.environ.get(name)), None)
    if sys.platform == "linux" and where is None:
        raise FaultError("there is no display, DISPLAY is not set")
    import glfw

    glfw.ERROR_REPORTING = "ignore"
    if not glfw.init():
        raise FaultError(f"the display {where or sys.platform!r} cannot be opened")
    glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
    window = glfw.create_window(64, 64, "", None, None)
    glfw.terminate()
    if not window:
        raise FaultError(f"the display {where or sys.platform!r} has no OpenGL")
    return HARDWARE


def _loaded(*alternatives: tuple[str, str]) -> Any:
    """Return the first library that loads, of those with a soname and the name find_library knows it by; or None."""
    for soname, name in alternatives:
        for each in _names(soname, name):
            try:
                return ctypes.CDLL(each, mode=ctypes.RTLD_GLOBAL)
            except OSError:
                pass
    return None


def _names(soname: str, name: str) -> Iterable[str]:
    yield soname
    found = ctypes.util.find_library(name)  # takes a while, and most often the soname has loaded
    if found is not None:
        yield found


TRIALS: dict[str, Callable[[], str]] = {"osmesa": try_osmesa, "egl": try_egl, "glfw": try_glfw}


def main() -> int:
    """Try the backend that the command line names; return the exit code."""
    _, backend, *path = sys.argv
    sys.path[:] = path or sys.path
    try:
        print(TRIALS[backend]())
    except FaultError as fault:
        print(fault)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
