"""The safety filter under dangerous commands: clearance from the ground, share of changed commands, and cost.

Three policies command the acceleration of ``safe-flight``, behind ``mathnavi.controllers.flight.command_filter``:

    random     accelerations within the bound, each held for a random time
    diving     at the greatest speed downwards in a random direction
    searched   u = a_max tanh(W phi), W (3, 10) by the cross-entropy method, which minimises the least clearance with
               the filter in place; phi = (1, velocity, slope, height, direction to the target)

Every other mission has noise and gusts, as declared. Contacts and clearance are computed from the true state over every
step, which is one arc of constant acceleration; a violation is a clearance below h_min that was not announced before.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, Positive, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.study_report import Table
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.environments.filtering import EpisodeFilter
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.records.statistics import rate
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import VEHICLE, Setup, StudyResult, TerrainReference

POLICIES = ("random", "diving", "searched")
DISTURBED = {"noise.position": 2.0, "faults.gust_rms": 1.0}
FEATURES = 10
MOST_MS = 0.3  # of the target
_PER_MISSION = 20  # episodes
_SHORT = 0.9  # of the mission's bounds
_ELITE = 0.25  # share of a population that the next one is drawn around
_COLOURS = {"random": "#2166ac", "diving": "#e08214", "searched": "#c2183b"}


@configuration
class SafetyFilterConfig:
    """Sample sizes: episodes that are flown."""

    episodes: Count = 1000
    """number of episodes of each policy"""
    seconds: Positive = 30.0
    """longest duration of an episode [s]"""
    timed: Count = 5
    """number of episodes of each policy in which the filter is timed, flown one after the other"""
    population: Count = 24
    """number of policies in each generation of the search"""
    generations: Count = 12
    """number of generations of the search"""


@dataclass(frozen=True)
class Episodes:
    """Episodes of one policy over one mission."""

    place: TerrainReference
    seed: int  # of the mission; an odd one has noise and gusts
    policy: str
    episodes: int
    seconds: float
    weights: tuple[float, ...] = ()  # of the searched policy


EpisodeFigures = Mapping[str, Any]
"""figures of episodes, one item each, by name, and the CPU times of a step in all episodes but the first

``least`` is the least clearance [m], ``changed`` and ``stored`` are the shares of the steps at which the command was
changed and the stored plan was flown, ``announced`` counts the steps at which the guarantee was lost.
"""


class SafetyFilterStudy:
    """The safety filter under random, diving and searched policies: contacts, changed commands, cost."""

    Config = SafetyFilterConfig
    quick = SafetyFilterConfig(episodes=4, seconds=10.0, timed=1, population=4, generations=2)
    title = "The safety filter under policies that come to harm"

    @staticmethod
    def run(config: SafetyFilterConfig, setup: Setup) -> StudyResult:
        (weights,) = setup.compute(
            searched, [Episodes(setup.place, 1, "searched", 1, min(config.seconds, 20.0))],
            population=config.population, generations=config.generations,
        )  # fmt: skip
        missions = math.ceil(config.episodes / _PER_MISSION)

        def asked_of(policy: str, seed: int, episodes: int) -> Episodes:
            return Episodes(
                setup.place, seed, policy, episodes, config.seconds, tuple(weights) if policy == "searched" else ()
            )

        asked = [
            asked_of(policy, seed, min(_PER_MISSION, config.episodes - seed * _PER_MISSION))
            for policy in POLICIES
            for seed in range(missions)
        ]
        flown = setup.compute(fly, asked)
        # The first episode of a process loads what is compiled, and another process beside it would take its caches.
        timed = [setup.compute(fly, [asked_of(policy, missions, 1 + config.timed)])[0] for policy in POLICIES]
        by_policy = {
            policy: [result for each, result in zip(asked, flown, strict=True) if each.policy == policy]
            for policy in POLICIES
        }
        rows = [_row(policy, by_policy[policy], alone) for policy, alone in zip(POLICIES, timed, strict=True)]
        total = sum(row["episodes"] for row in rows)
        contacts, violations = (sum(row[key] for row in rows) for key in ("contacts", "violations"))
        dearest = max(row["mean_ms"] for row in rows)
        return StudyResult(
            summary=(
                f"{config.episodes} episodes of at most {config.seconds:g} s over {setup.ground.name} for each of "
                f"{len(POLICIES)} policies, {_PER_MISSION} a mission; every other mission has position noise of "
                f"{DISTURBED['noise.position']:g} m and gusts of {DISTURBED['faults.gust_rms']:g} m/s² rms. The "
                f"searched policy is the best of {config.population * config.generations}. Times are thread CPU "
                f"times of a step of the filter over {config.timed} more episodes of each policy, one after the other.",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(by_policy),
            caption="Least clearance of every episode, and the share of commands that were changed.",
            claims=(
                Claim(
                    "guarantee.filter", "target",
                    "Behind the filter no policy touches the ground or comes below h_min unannounced.",
                    "The certificate of every plan", f"none of {total}, a step in at most {MOST_MS:g} ms on the mean",
                    f"contacts {rate(contacts, total).text()}; violations {rate(violations, total).text()}; least "
                    f"clearance {min(row['least_m'] for row in rows):.2f} m; changed "
                    + ", ".join(f"{row['changed']:.0%} ({row['policy']})" for row in rows)
                    + f"; mean of at most {dearest:.2f} ms",
                    contacts == 0 and violations == 0 and dearest <= MOST_MS,
                ),
            ),
        )  # fmt: skip


def fly(asked: Episodes) -> EpisodeFigures:
    """A job: fly episodes of a policy behind the filter."""
    runner = _runner(asked)
    return _flown(runner, asked, [np.random.default_rng([asked.seed, k]) for k in range(asked.episodes)])


def searched(asked: Episodes, population: int, generations: int) -> tuple[float, ...]:
    """A job: weights (30,) of a policy that minimises the least clearance, by the cross-entropy method."""
    rng, runner = np.random.default_rng(asked.seed), _runner(asked)
    mean, deviation = np.zeros(3 * FEATURES), np.ones(3 * FEATURES)
    best, least = mean, np.inf
    for _ in range(generations):
        drawn = mean + deviation * rng.normal(size=(population, 3 * FEATURES))
        costs = np.array([_least(runner, asked, tuple(weights.tolist())) for weights in drawn])
        elite = drawn[np.argsort(costs, kind="stable")[: max(2, round(_ELITE * population))]]
        mean, deviation = elite.mean(axis=0), elite.std(axis=0) + 0.05
        if costs.min() < least:
            best, least = drawn[costs.argmin()], costs.min()
    return tuple(float(weight) for weight in best)


def _least(runner: EpisodeRunner, asked: Episodes, weights: tuple[float, ...]) -> float:
    """Return the least clearance [m] of one episode with these weights."""
    one = Episodes(asked.place, asked.seed, "searched", 1, asked.seconds, weights)
    (least,) = _flown(runner, one, [np.random.default_rng(asked.seed)])["least"]
    return float(least)


def _runner(asked: Episodes) -> EpisodeRunner:
    _ = asked.place.ground  # which refuses heights that have changed
    fields: dict[str, Any] = {"terrain": asked.place.terrain, **(DISTURBED if asked.seed % 2 else {})}
    return EpisodeRunner(RunSpec.of("safe-flight", asked.seed, fields=fields))


def _flown(runner: EpisodeRunner, asked: Episodes, rngs: Sequence[np.random.Generator]) -> EpisodeFigures:
    ground, h_min = asked.place.ground, float(runner.mission["clearance_min"])
    columns: dict[str, list[Any]] = {
        name: [] for name in ("least", "contacts", "violations", "changed", "stored", "announced", "steps")
    }
    times: list[float] = []
    for rng in rngs:
        observation = runner.begin(int(rng.integers(2**31)))
        safe, policy = EpisodeFilter(runner), _Policy(asked, runner, ground, rng)
        infos: list[dict[str, Any]] = []
        for _ in range(round(asked.seconds / runner.period)):
            proposed = policy.command(float(observation["t"]), observation["x"])
            began = time.thread_time()
            u = safe.filtered(proposed)
            times.append(1e3 * (time.thread_time() - began))
            infos.append(safe.decided())
            made = runner.step(u)
            observation = made.observation
            if made.last:
                break
        clearance = _clearances(ground, runner, len(infos))
        lost = np.array([not info["guaranteed"] for info in infos])
        announced = np.logical_or.accumulate(lost)
        columns["least"].append(float(clearance.min()))
        columns["contacts"].append(int((clearance <= 0.0).any()))
        columns["violations"].append(int(((clearance < h_min) & ~announced).any()))
        columns["changed"].append(float(np.mean([info["intervened"] for info in infos])))
        columns["stored"].append(float(np.mean([info["flown"] == "stored plan" for info in infos])))
        columns["announced"].append(int(lost.sum()))
        columns["steps"].append(len(infos))
    warm = times[columns["steps"][0] :] or times
    return {**columns, "mean_ms": MeasuredTime(np.mean(warm)), "p99_ms": MeasuredTime(np.percentile(warm, 99))}


def _clearances(ground: HeightField, runner: EpisodeRunner, steps: int) -> Array:
    """Return the least clearance (steps,) [m] of the true state over each step."""
    recording = runner.recording
    t, x = recording.t, recording.truths[VEHICLE]
    duration = np.diff(t)
    a = np.diff(x[:, 3:], axis=0) / duration[:, np.newaxis]
    return ground.path_clearance(x[:-1, :3], x[:-1, 3:], a, duration)[:steps]


class _Policy:
    """Policy of one episode, by the name in ``Episodes``."""

    def __init__(self, asked: Episodes, runner: EpisodeRunner, ground: HeightField, rng: np.random.Generator) -> None:
        self._name, self._rng, self._ground = asked.policy, rng, ground
        self._weights = np.reshape(asked.weights, (3, -1)) if asked.weights else np.zeros((3, FEATURES))
        mission = runner.mission
        self._target = np.array(mission["target"])
        # Short of the bounds, which the filter keeps too: what it changes is what leads into the ground.
        self._a_max, self._v_max = (_SHORT * float(mission[name]) for name in ("acceleration_max", "speed_max"))
        self._hold = float(rng.choice([0.0, 0.25, 1.0, 4.0]))  # [s]
        heading = rng.uniform(-math.pi, math.pi)
        down = rng.uniform(0.1, 1.2)  # [rad] below the horizon
        self._dive = self._v_max * np.array(
            [math.cos(heading) * math.cos(down), math.sin(heading) * math.cos(down), -math.sin(down)]
        )
        self._held, self._until = np.zeros(3), -math.inf

    def command(self, t: float, x: Array) -> Array:
        """Return the proposed acceleration (3,) [m/s^2] at t [s] for an estimate (6,) [m, m/s]."""
        if self._name == "random":
            if t >= self._until:
                direction = self._rng.normal(size=3)
                size = self._a_max * self._rng.uniform() ** (1.0 / 3.0)
                self._held, self._until = size * direction / np.linalg.norm(direction), t + self._hold
            return self._held
        if self._name == "diving":
            return self._limited(2.0 * (self._dive - x[3:]))
        ahead = self._target - x[:3]
        slope = np.nan_to_num(self._ground.gradient(x[0], x[1]))
        height = float(np.nan_to_num(x[2] - self._ground.height(x[0], x[1])))
        features = np.concatenate(
            [[1.0], x[3:] / 100.0, slope, [height / 200.0], ahead / max(float(np.linalg.norm(ahead)), 1.0)]
        )
        return self._limited(self._a_max * np.tanh(self._weights @ features))

    def _limited(self, u: Array) -> Array:
        size = float(np.linalg.norm(u))
        return u if size <= self._a_max else u * (self._a_max / size)


def _row(policy: str, results: Sequence[EpisodeFigures], timed: EpisodeFigures) -> dict[str, Any]:
    steps = np.concatenate([each["steps"] for each in results])

    def share(name: str) -> float:
        return float(np.average(np.concatenate([each[name] for each in results]), weights=steps))

    return {
        "policy": policy,
        "episodes": len(steps),
        "steps": int(steps.sum()),
        "contacts": sum(sum(each["contacts"]) for each in results),
        "violations": sum(sum(each["violations"]) for each in results),
        "least_m": min(min(each["least"]) for each in results),
        "changed": share("changed"),
        "stored": share("stored"),
        "announced": sum(sum(each["announced"]) for each in results),
        "mean_ms": float(timed["mean_ms"]),
        "p99_ms": float(timed["p99_ms"]),
    }


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Policies", rows, (
        ("policy", "policy"), ("episodes", "episodes"),
        ("contacts", lambda r: rate(r["contacts"], r["episodes"]).text()),
        ("violations", lambda r: rate(r["violations"], r["episodes"]).text()), ("least clearance", "{least_m:.2f} m"),
        ("changed", "{changed:.1%}"), ("stored plan flown", "{stored:.1%}"), ("announced steps", "announced"),
        ("mean of a step", "{mean_ms:.3f} ms"), ("99 % of the steps", "{p99_ms:.3f} ms"),
    ))  # fmt: skip


def _figure(by_policy: dict[str, list[EpisodeFigures]]) -> Figure:
    with styled_figure((9.4, 3.4)) as figure:
        clearance, changed = figure.subplots(1, 2)
        for policy, results in by_policy.items():
            for axes, name in ((clearance, "least"), (changed, "changed")):
                sample = np.concatenate([each[name] for each in results])
                shares = (np.arange(len(sample)) + 1.0) / len(sample)
                axes.plot(np.sort(sample), shares, color=_COLOURS[policy], label=policy)
        clearance.axvline(50.0, ls=":", color="#5a6876")
        clearance.set(xlabel="least clearance [m]", ylabel="share of the episodes", title="Clearance", xlim=(0.0, None))
        changed.set(xlabel="share of the commands", title="Commands that were changed", xlim=(0.0, 1.0))
        clearance.legend(fontsize=8)
    return figure
