"""Measurements of our software, beside other people's where there is one that does the same."""

import os

OPENGL = os.environ.get("MUJOCO_GL", "")  # as the caller has it: parts that draw nothing switch it off
