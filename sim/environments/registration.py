"""The names under which Gymnasium makes the installed scenarios: "mathnavi/SafeFlight-v0" of ``safe-flight``."""

from __future__ import annotations

from gymnasium.envs.registration import register as registered

from mathnavi.sim.plugin.registry import names

VERSION = 0
"""of every environment: another one where the same actions would lead to other observations or rewards"""


def identifier(scenario: str) -> str:
    """Identifier of a scenario in Gymnasium."""
    return f"mathnavi/{''.join(part.capitalize() for part in scenario.split('-'))}-v{VERSION}"


def register() -> None:
    """Make every installed scenario known; none of them is imported before it is made."""
    for scenario in names("scenarios"):
        registered(identifier(scenario), "mathnavi.sim.environments.gym:ScenarioEnv", kwargs={"scenario": scenario})
