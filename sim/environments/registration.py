"""The names under which Gymnasium makes the installed scenarios: "mathnavi/SafeFlight-v1" of ``safe-flight``."""

from __future__ import annotations

from gymnasium.envs.registration import register as registered

from mathnavi.sim.plugin.registry import names

ENTRY_POINTS = ("mathnavi.sim.environments.gym:ScenarioEnv", "mathnavi.sim.environments.gym:LearningEnv")
"""of every scenario, by version: another one where the same actions lead to other observations or rewards"""
VECTORS = {"safe-flight": "mathnavi.sim.environments.vector:SafeFlightVectorEnv"}
"""scenarios of whose last version many missions are stepped at once"""


def identifier(scenario: str, version: int) -> str:
    """Identifier of a scenario in Gymnasium."""
    return f"mathnavi/{''.join(part.capitalize() for part in scenario.split('-'))}-v{version}"


def register() -> None:
    """Make every installed scenario known; none of them is imported before it is made."""
    for scenario in names("scenarios"):
        for version, entry_point in enumerate(ENTRY_POINTS):
            vector = VECTORS.get(scenario) if version == len(ENTRY_POINTS) - 1 else None
            registered(
                identifier(scenario, version), entry_point, kwargs={"scenario": scenario}, vector_entry_point=vector
            )
