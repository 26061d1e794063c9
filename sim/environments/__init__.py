"""Scenarios as environments. Where Gymnasium is installed, importing this makes them known to it.

Gymnasium looks for no plug-ins of its own accord: what is imported registers what it has.
"""

from importlib.util import find_spec

from mathnavi.renders.opengl import import_mujoco

import_mujoco()

if find_spec("gymnasium") is not None:
    from mathnavi.sim.environments.registration import register

    register()
