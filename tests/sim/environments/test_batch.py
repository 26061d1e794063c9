"""Rollouts of a scenario's plant: the states of the loop, bit for bit, on any number of threads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.fields import with_fields
from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.loop import Loop
from mathnavi.sim.environments.batch import load
from mathnavi.sim.plugin.registry import load as plugin
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from tests.sim.environments import missions

N, K = 2, 12


def flown(closed_loop: ClosedLoop, commands: Array) -> Array:
    """(K + 1, n, nx) by the loop's plant, commands (K, n, nu)."""
    loop, names = Loop(closed_loop.plant, closed_loop.agents, closed_loop.duration), list(closed_loop.agents)
    loop.observe()
    states = [np.array([loop.truths[name] for name in names])]
    for held in commands:
        for name, u in zip(names, held, strict=True):
            loop.command(name, u)
        loop.advance()
        loop.observe()
        states.append(np.array([loop.truths[name] for name in names]))
    return np.array(states)


@pytest.mark.parametrize(
    ("scenario", "fields", "largest"),
    [
        ("simultaneous-arrival", {}, 60.0),  # beyond the bound, too
        ("quadrotor-canyon", {}, 20.0),
        ("missile-guidance", {}, 1e4),
        ("range-localisation", {"drive": "differential"}, 1.0),
        ("arm-velocity", {}, 5.0),
    ],
)
def test_every_run_is_that_of_the_loops_plant(scenario: str, fields: dict[str, Any], largest: float) -> None:
    fields = {**missions.fields(scenario), **fields}
    rollouts = load(scenario, seed=1, threads=2, **fields)
    config = with_fields(plugin("scenarios", scenario).Config(), fields)
    closed_loops = [plugin("scenarios", scenario).build(config, 1) for _ in range(N)]
    nu = [agent.input_size for agent in closed_loops[0].agents.values()]
    rows = (len(nu),) if len(nu) > 1 else ()
    commands = np.random.default_rng(0).uniform(-largest, largest, (N, K, *rows, nu[0]))
    states = rollouts.states(np.repeat(rollouts.start[None], N, axis=0), commands)
    assert states.shape == (N, K + 1, *rollouts.start.shape)
    for run, held, closed_loop in zip(states, commands, closed_loops, strict=True):
        again = flown(closed_loop, held.reshape(K, len(nu), nu[0]))
        np.testing.assert_array_equal(run.reshape(again.shape), again)


def test_runs_start_where_they_are_put_and_a_bad_start_or_command_is_refused() -> None:
    rollouts = load("sphere-observer", seed=1)
    starts = np.repeat(rollouts.start[None], 2, axis=0)
    starts[1, 4:] *= -1.0
    states = rollouts.states(starts, np.zeros((2, 3, 3)))
    np.testing.assert_array_equal(states[:, 0], starts)
    assert not np.array_equal(states[0, 1], states[1, 1])
    for bad, commands, expected in (
        (starts[:, :6], np.zeros((2, 3, 3)), "starts has shape (2, 6); allowed: (N, 7), N >= 1"),
        (starts, np.zeros((1, 3, 3)), "commands has shape (1, 3, 3); allowed: (2, K, 3), a sequence for each start"),
        (starts, np.full((2, 3, 3), np.nan), "commands[(0, 0, 0)] = nan; allowed: finite numbers"),
        (2.0 * starts, np.zeros((2, 3, 3)), "allowed: "),
    ):
        with pytest.raises(ValueError, match="allowed") as refusal:
            rollouts.states(bad, commands)
        assert expected in str(refusal.value)


@pytest.mark.parametrize(
    ("scenario", "fields", "expected"),
    [
        ("textbook-observer", {}, "is an ODE; allowed: one that MuJoCo moves"),
        ("missile-guidance", {"actuator": {"delay": 0.01}}, "actuators of 'missile-guidance' are 10 ticks late"),
        ("sphere-observer", {"threads": -1}, "threads = -1; allowed: a whole number >= 0"),
    ],
)
def test_what_cannot_be_rolled_out_is_refused(scenario: str, fields: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match="allowed") as refusal:
        load(scenario, **fields)
    assert expected in str(refusal.value)
