"""Pictures that another process draws (``draw_and_leave_out.py``), and where two of them differ."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from mathnavi.renders import opengl
from mathnavi.sim.interfaces.signals import Array

SCRIPT = Path(__file__).with_name("draw_and_leave_out.py")
needs_opengl = pytest.mark.skipif(opengl.available() is None, reason=opengl.HOW_TO_INSTALL)


def drawn(kind: str, folder: Path, *runs: Path) -> Mapping[str, Array]:
    """Pictures of runs of a kind, with and without parts of what they show, drawn into ``folder``."""
    out = folder / "out.npz"
    environment = opengl.environment() | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, str(SCRIPT), kind, str(out), *map(str, runs)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # an unclosed renderer complains at exit
    return dict(np.load(out))


def differing(one: Array, other: Array, least: int = 12) -> tuple[Array, Array]:
    """Rows and columns of the pixels of which a channel differs by more than ``least``."""
    rows, columns = np.nonzero(np.abs(one.astype(int) - other.astype(int)).max(axis=-1) > least)
    return rows, columns
