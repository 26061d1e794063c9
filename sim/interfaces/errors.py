"""Named exceptions, so that a script can catch what it expects; every one of them is a ``ValueError``.

Each message is one line that names the culprit, its value and what is allowed.
"""

from __future__ import annotations


class FieldError(ValueError):
    """A field of a configuration is out of its range, of another type, or not a field at all."""


class ArgumentError(ValueError):
    """An argument of a function: an array of another shape, a value that is not finite or out of its range."""


class MissionError(ValueError):
    """A mission that cannot be flown: a start below ground, a target off the map, vehicles too close to each other."""


class TerrainError(ValueError):
    """A terrain that is not known, or a file of heights that is malformed."""


class PluginError(ValueError):
    """A plug-in that is not known, cannot be imported, or does not keep to its protocol."""


class RunFolderError(ValueError):
    """The folder of a run, or one of its files, that is broken or not what it should be."""


class UntrustedError(RunFolderError):
    """The folder of a run that names code which is not installed, and which nobody has trusted."""


class LogError(ValueError):
    """A log of one's own whose times, readings or inputs are malformed, or not those that an estimator needs."""


class StoreError(ValueError):
    """The store of a sweep that is broken, or not one."""


class ProblemError(ValueError):
    """An optimal control problem, or a mesh for one, that is not well stated."""


class SolutionFileError(ValueError):
    """The file of a solution of an optimal control problem that is broken, or not one."""
