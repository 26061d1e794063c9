"""Exceptions by name, so that a script can catch those that it expects; each of them is a ``ValueError``.

Each message is one line that names the culprit, its value and what is allowed.
"""

from __future__ import annotations


class FieldError(ValueError):
    """Field of a configuration that is out of its range, of another type, or not a field at all."""


class ArgumentError(ValueError):
    """Wrong argument of a function: an array of another shape, a value that is not finite or out of its range."""


class MissionError(ValueError):
    """Mission that cannot be flown: a start below ground, a target off the map, vehicles too close to each other."""


class TerrainError(ValueError):
    """Terrain that is unknown, or a malformed file of heights."""


class PluginError(ValueError):
    """Plug-in that is unknown, cannot be imported, or does not follow its protocol."""


class RunFolderError(ValueError):
    """Folder of a run, or one of its files, that is broken or of another kind."""


class UntrustedError(RunFolderError):
    """Folder of a run that names code which is not installed, and which the user has not trusted."""


class LogError(ValueError):
    """Log of the user whose times, readings or inputs are malformed, or not those that an estimator needs."""


class StoreError(ValueError):
    """Store of a sweep that is broken, or a file that is not a store."""


class ProblemError(ValueError):
    """Optimal control problem, or a mesh for one, that is ill-posed."""


class SolutionFileError(ValueError):
    """File of a solution of an optimal control problem that is broken, or a file of another kind."""
