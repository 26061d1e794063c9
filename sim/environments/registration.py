"""Registration of the installed scenarios in Gymnasium: ``safe-flight`` becomes "mathnavi/SafeFlight-v1"."""

from __future__ import annotations

from gymnasium.envs.registration import register as registered

from mathnavi.sim.plugin.registry import names

ENTRY_POINTS = ("mathnavi.sim.environments.gym:ScenarioEnv", "mathnavi.sim.environments.gym:LearningEnv")
"""entry point of every scenario, by version: a new one if the same actions lead to other observations or rewards"""
VECTORS = {"safe-flight": "mathnavi.sim.environments.vector:SafeFlightVectorEnv"}
"""entry points of the scenarios whose last version steps many missions at once"""


def identifier(scenario: str, version: int) -> str:
    """Return the identifier of a scenario in Gymnasium."""
    return f"mathnavi/{''.join(part.capitalize() for part in scenario.split('-'))}-v{version}"


def register() -> None:
    """Register every installed scenario; none of them is imported before it is made."""
    for scenario in names("scenarios"):
        for version, entry_point in enumerate(ENTRY_POINTS):
            vector = VECTORS.get(scenario) if version == len(ENTRY_POINTS) - 1 else None
            registered(
                identifier(scenario, version), entry_point, kwargs={"scenario": scenario}, vector_entry_point=vector
            )
