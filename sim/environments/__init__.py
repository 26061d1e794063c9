"""Environments of the scenarios. If Gymnasium is installed, importing this package registers them there.

Gymnasium does not discover plug-ins by itself: a package registers its environments when it is imported.
"""

from importlib.util import find_spec

from mathnavi.models.opengl import import_mujoco

import_mujoco()

if find_spec("gymnasium") is not None:
    from mathnavi.sim.environments.registration import register

    register()
