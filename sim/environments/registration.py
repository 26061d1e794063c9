"""Registration of the installed scenarios in Gymnasium: ``safe-flight`` becomes "mathnavi/SafeFlight-v1"."""

from __future__ import annotations

import gymnasium
from gymnasium.envs.registration import EnvSpec

from mathnavi.sim.plugin.registry import names

ENTRY_POINTS = ("mathnavi.sim.environments.gym:ScenarioEnv", "mathnavi.sim.environments.gym:LearningEnv")
"""entry point of every scenario, by version: a new one if the same actions lead to other observations or rewards"""
VECTORS = {"safe-flight": "mathnavi.sim.environments.vector:SafeFlightVectorEnv"}
"""entry points of the scenarios whose last version steps many missions at once"""


def identifier(scenario: str, version: int) -> str:
    """Return the identifier of a scenario in Gymnasium."""
    return f"mathnavi/{''.join(part.capitalize() for part in scenario.split('-'))}-v{version}"


class ScenarioSpec(EnvSpec):
    """Specification of an environment that no later version of its scenario replaces.

    To Gymnasium a version is out of date as soon as the registry holds a higher one of the same name. Here v0 is the
    scenario itself and v1 the same for learning, and both are meant: in the registry neither has a number to compare.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self.version = None


def register() -> None:
    """Register every installed scenario; none of them is imported before it is made.

    Without a version a name stands for the last one, as everywhere in Gymnasium.
    """
    for scenario in names("scenarios"):
        for version, entry_point in enumerate(ENTRY_POINTS):
            vector = VECTORS.get(scenario) if version == len(ENTRY_POINTS) - 1 else None
            known = identifier(scenario, version)
            spec = ScenarioSpec(known, entry_point, kwargs={"scenario": scenario}, vector_entry_point=vector)
            gymnasium.registry[known] = gymnasium.registry[known.rpartition("-v")[0]] = spec
