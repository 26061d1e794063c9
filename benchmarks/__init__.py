"""Benchmarks of mathnavi, compared with other software where some solves the same problem."""

import os

OPENGL = os.environ.get("MUJOCO_GL", "")  # as the caller has it: parts that draw nothing switch it off
