"""dm_control's ``composer`` and ``mjcf``, imported in silence: its renderer, unused here, warns without a display."""

from __future__ import annotations

import warnings

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from dm_control import composer, mjcf

__all__ = ["composer", "mjcf"]
