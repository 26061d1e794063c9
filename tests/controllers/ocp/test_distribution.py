"""(B.1) and its examples: what holds of the nodes when they are unknowns."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from mathnavi.controllers.ocp.distribution import (
    EquidistantHorizon,
    Equidistributed,
    Fixed,
    Free,
    FrontLoaded,
    FunctionalMinimised,
)
from mathnavi.controllers.ocp.methods.adaptation import distribute, gated, redistribute, refine, solve, worse_figures
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, UNIFORM, Monitor
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.manuals import hypersensitive_short, van_der_pol
from mathnavi.controllers.ocp.problems.missile import missile
from mathnavi.controllers.ocp.residual import local_errors
from mathnavi.controllers.ocp.solution import ReplayResult, Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson, MultipleShooting
from tests.controllers.ocp.statements import integrator
from tests.perturbed_starts import perturbed_starts


def coasting(longest: float) -> ProblemFunctions:
    """J asks nothing of the final time, at most ``longest`` [s]."""
    ocp, _, u = integrator("coasting")
    ocp.free_duration(guess=0.5 * longest, lower=1e-3, upper=longest)
    ocp.minimise(running=u**2)
    return ocp.functions()


@pytest.mark.parametrize(("epsilon", "step"), [(0.1, 0.1), (0.3, 0.3), (0.6, 0.6), (0.9, 0.6), (5.0, 0.6)])
def test_example_b1_is_the_equidistant_receding_horizon(epsilon: float, step: float) -> None:
    solution = transcription(coasting(6.0), Euler(), 11, EquidistantHorizon(epsilon)).solve()
    assert solution.solved
    assert np.allclose(np.diff(solution.t), step, rtol=1e-4)


@pytest.mark.parametrize("measure", [ARCLENGTH, CURVATURE])
def test_equidistribution_in_the_programme_gives_every_interval_the_same_share(measure: Monitor) -> None:
    epsilon = 0.01 if measure is ARCLENGTH else 1e3
    solution = distribute(missile("FAST"), 15, Equidistributed(measure, epsilon))
    assert solution.status is SolverOutcome.OPTIMAL
    scale = solution.problem.state_scale
    D, chords = solution.grid.widths * 14.0, np.diff(solution.x, axis=0) / scale
    if measure is ARCLENGTH:
        shares = np.sqrt(14.0**2 * (chords**2).sum(axis=1) + epsilon * D**2)
    else:
        turns = (
            (solution.rates[:, -1] - solution.rates[:, 0]) / scale * solution.duration / solution.grid.widths[:, None]
        )
        shares = D * (epsilon + (turns**2).sum(axis=1)) ** 0.25
    assert np.ptp(shares) < 1e-6 * shares.mean()
    assert np.ptp(D) > 0.1


def test_the_uniform_monitor_in_the_programme_is_the_uniform_grid() -> None:
    solution = distribute(missile("SM2"), 11, Equidistributed(UNIFORM))
    assert np.allclose(solution.grid.widths, 0.1, atol=1e-7)


def test_example_b2_puts_its_share_of_nodes_in_front_with_equal_steps() -> None:
    solution = distribute(missile("FAST"), 15, FrontLoaded(share_of_nodes=0.5, share_of_time=0.4))
    assert solution.status is SolverOutcome.OPTIMAL
    widths = solution.grid.widths
    assert widths[:7].sum() <= 0.4 + 1e-7
    assert np.ptp(widths[:7]) < 1e-7
    assert np.ptp(widths[7:]) < 1e-7


@pytest.mark.parametrize("distribution", [Free(), FrontLoaded(0.5, 0.4, equal_steps=False)])
@pytest.mark.parametrize("scheme", [Euler(), HermiteSimpson()])
def test_free_nodes_are_exploited_and_refused(distribution: Free | FrontLoaded, scheme: Euler | HermiteSimpson) -> None:
    problem = missile("SM2")
    even = solve(problem, 20, scheme=scheme)
    solution = distribute(problem, 20, distribution, scheme=scheme)
    assert solution.status is SolverOutcome.REFUSED
    assert solution.solved
    assert solution.cost == pytest.approx(even.cost, abs=1e-9)
    assert np.allclose(solution.grid.nodes, even.grid.nodes)
    assert "replays with" in solution.message


def test_functional_minimisation_evens_the_shares_out() -> None:
    def spread(solution: Solution) -> float:
        chords = np.diff(solution.x, axis=0) / solution.problem.state_scale
        shares = np.sqrt((chords**2).sum(axis=1))
        return float(shares.std() / shares.mean())

    problem = missile("FAST")
    even, found = solve(problem, 15), distribute(problem, 15, FunctionalMinimised())
    assert spread(found) < 0.7 * spread(even)
    assert found.cost == pytest.approx(even.cost, rel=1e-3)  # J, without the functional


@pytest.mark.parametrize("measure", [CURVATURE, LOCAL_ERROR], ids=lambda measure: measure.name)
def test_one_redistribution_of_the_fast_missile_is_far_more_accurate(measure: Monitor) -> None:
    problem = missile("FAST")
    even, moved = solve(problem, 15), redistribute(problem, 15, measure)
    assert moved.status is SolverOutcome.OPTIMAL
    assert even.replay is not None
    assert moved.replay is not None
    assert moved.replay.miss < 0.1 * even.replay.miss


def test_a_monitor_of_ones_own_takes_the_nodes_where_it_wants_them() -> None:
    early = Monitor("early", lambda solution, tau, epsilon: np.exp(-3.0 * tau), None, epsilon=1.0)
    solution = redistribute(missile("SM2"), 20, early)
    grid = solution.grid.widths if solution.status is SolverOutcome.OPTIMAL else None
    assert grid is None or (np.diff(grid) > 0.0).all()
    with pytest.raises(ValueError, match="'early' has no measure"):
        Equidistributed(early)


def test_refinement_stops_at_its_tolerance_and_says_so() -> None:
    solution = refine(missile("SM2"), tolerance=1e-4)
    assert solution.status is SolverOutcome.OPTIMAL
    assert local_errors(solution).max() <= 1e-4
    assert solution.message.startswith("local error at most")
    assert solution.cost == pytest.approx(11.541173, abs=1e-4)


def test_refinement_that_runs_out_of_nodes_says_so() -> None:
    solution = refine(missile("SM2"), 6, most_nodes=11, tolerance=1e-9)
    assert solution.nodes <= 11
    assert "local error still" in solution.message or solution.status is SolverOutcome.REFUSED


def test_the_gate_prefers_the_uniform_solution_to_a_failed_one() -> None:
    even = solve(missile("SM2"), 20)
    failed = transcription(missile("SM2"), HermiteSimpson(), 20).solve(parameters=np.empty(0))
    answer = gated(dataclasses.replace(failed, status=SolverOutcome.LIMIT, message="stopped"), even, "any", 1e-6)
    assert answer.status is SolverOutcome.REFUSED
    assert "stopped" in answer.message


@pytest.mark.parametrize(
    ("own", "refused"),
    [
        ({"miss": 2e-5}, ""),  # a figure of the uniform solution that is larger does not matter, nor a factor of two
        ({"miss": 4e-5}, "miss of 4e-05, uniform with 1e-05"),
        ({"path_violation": 1e-2}, ""),
        ({"path_violation": 4e-2}, "path violation of 0.04, uniform with 0.01"),
        ({"control_violation": 1.0}, ""),  # it is not flown
        ({"cost_error": 9e-7}, ""),  # within the tolerance
        ({"cost_error": 2e-6}, "cost error of 2e-06, uniform with 0"),
        ({"miss": np.nan}, "miss of nan"),
    ],
)
def test_the_gate_judges_each_figure_on_its_own(own: dict[str, float], refused: str) -> None:
    even = ReplayResult(1e-5, 1e-2, 0.0, 0.0, 1.0, np.zeros(1), by_intervals=False)
    found = worse_figures(dataclasses.replace(even, **own), even, 1e-6)
    assert "; ".join(found) == refused if refused != "miss of nan" else found[0].startswith(refused)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Equidistributed(epsilon=0.0),
        lambda: FunctionalMinimised(weight=-1.0),
        lambda: EquidistantHorizon(np.nan),
        lambda: FrontLoaded(share_of_nodes=1.0),
        lambda: FrontLoaded(share_of_time=0.0),
        lambda: distribute(missile("SM2"), 2, FrontLoaded()),
        lambda: distribute(missile("SM2"), 10, Fixed()),
        lambda: distribute(missile("SM2"), 1),
        lambda: redistribute(missile("SM2"), 10, rounds=0),
        lambda: refine(missile("SM2"), 10, most_nodes=5),
        lambda: refine(missile("SM2"), tolerance=0.0),
        lambda: refine(missile("SM2"), scheme=MultipleShooting()),
        lambda: missile("SLOW"),
    ],
)
def test_what_makes_no_sense_is_refused_with_what_is_allowed(wrong: object) -> None:
    with pytest.raises(ValueError, match=r"allowed"):
        wrong()  # type: ignore[operator]


@pytest.mark.parametrize(
    ("stated", "monitor", "cost"),
    [
        (hypersensitive_short, ARCLENGTH, 1.551043),
        (hypersensitive_short, CURVATURE, 1.332641),
        (van_der_pol, CURVATURE, 3.174321),
    ],
)
def test_nodes_inside_the_programme_end_where_they_do_from_any_start(
    stated: Callable[[], ProblemFunctions], monitor: Monitor, cost: float
) -> None:
    """From the programme's cold start three starts end in three minima."""
    problem = stated()
    even = solve(problem, 15, tolerance=1e3)
    for seed in range(3):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(even.x.shape) * problem.state_scale
        with perturbed_starts(seed):
            found = distribute(
                problem,
                15,
                Equidistributed(monitor, monitor.epsilon),
                guess=dataclasses.replace(even, x=even.x + noise),
            )
        assert found.cost == pytest.approx(cost, rel=1e-6)
