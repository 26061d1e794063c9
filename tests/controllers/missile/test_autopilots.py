"""The autopilots: exact on the plan, back to it when off, and sure of where they will be."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from mathnavi.controllers.missile.autopilot import Autopilot, FeedbackLinearisation, OpenLoop
from mathnavi.controllers.missile.tvlqr import TimeVaryingLQR, gains
from mathnavi.interfaces.signals import OPTIMISED, Array, Estimate, Plan
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL, Body
from mathnavi.models.missile.mission import MissileMission, Target
from tests.controllers.missile.flights import deviation, first_plan, mission

AUTOPILOTS: dict[str, Callable[[MissileMission], Autopilot]] = {
    "open-loop": OpenLoop,
    "feedback-linearisation": lambda guidance: FeedbackLinearisation(guidance, 8.0),
    "tvlqr": TimeVaryingLQR,
}
CLOSED = ("feedback-linearisation", "tvlqr")


@cache
def flight(coordinates: Coordinates) -> tuple[MissileMission, Plan]:

    guidance = (
        mission(coordinates) if coordinates is PLANAR else mission(coordinates, target=Target((700.0, 120.0, 0.0)))
    )
    return guidance, first_plan(guidance)


@pytest.fixture(scope="module", params=[PLANAR, SPATIAL], ids=["planar", "spatial"])
def flown(request: pytest.FixtureRequest) -> tuple[MissileMission, Plan]:
    return flight(request.param)


@pytest.fixture(params=sorted(AUTOPILOTS))
def autopilot(request: pytest.FixtureRequest, flown: tuple[MissileMission, Plan]) -> Autopilot:
    return AUTOPILOTS[request.param](flown[0])


def fly(
    autopilot: Autopilot,
    guidance: MissileMission,
    plan: Plan,
    x: Array,
    t: float,
    end: float,
    body: Body = NOMINAL,
    wrench: Array | None = None,
    limits: Array | None = None,
) -> Array:
    """The state (nx,) at ``end`` of a body that starts from x at t and feels ``wrench`` (nu,) beside its input."""
    coordinates = guidance.coordinates
    steps = round((end - t) / autopilot.period)
    for k in range(steps):
        now = t + k * autopilot.period
        u = autopilot.command(now, Estimate(now, x), plan)
        if limits is not None:
            u = np.clip(u, -limits, limits)
        x = coordinates.flow(x, u + (0.0 if wrench is None else wrench), autopilot.period, body)
    return x


def error(guidance: MissileMission, plan: Plan, x: Array, t: float) -> Array:
    return x - guidance.coordinates.state_at(plan, t)


def test_on_the_plan_the_command_is_the_plans_mean_input(
    autopilot: Autopilot, flown: tuple[MissileMission, Plan]
) -> None:
    guidance, plan = flown
    size = np.abs(plan.u).max(axis=0)
    for t in np.linspace(0.0, plan.t_end, 40):
        x = guidance.coordinates.state_at(plan, float(t))
        fine = t + autopilot.period * (np.arange(200) + 0.5) / 200.0
        mean = np.mean([guidance.coordinates.input_at(plan, float(at)) for at in fine], axis=0)
        command = autopilot.command(float(t), Estimate(float(t), x), plan)
        np.testing.assert_allclose(command / size, mean / size, rtol=0.0, atol=2e-2)
        arc = np.searchsorted(plan.t, t, side="right") - 1
        if t + autopilot.period < plan.t[min(arc + 1, len(plan.t) - 1)]:  # within one arc it is exact
            np.testing.assert_allclose(command / size, plan.u[min(arc, len(plan.u) - 1)] / size, rtol=0.0, atol=1e-9)


def test_what_follows_the_plan_stays_on_it(autopilot: Autopilot, flown: tuple[MissileMission, Plan]) -> None:
    guidance, plan = flown
    end = 4.0
    x = fly(autopilot, guidance, plan, plan.x[0].copy(), 0.0, end)
    assert np.linalg.norm(guidance.coordinates.place(error(guidance, plan, x, end))) < 2e-3


@pytest.mark.parametrize("name", CLOSED)
def test_off_the_plan_it_comes_back(name: str, flown: tuple[MissileMission, Plan]) -> None:
    guidance, plan = flown
    autopilot, t = AUTOPILOTS[name](guidance), 2.0
    start = guidance.coordinates.state_at(plan, t) + deviation(guidance, 1.0)
    before = np.linalg.norm(guidance.coordinates.place(error(guidance, plan, start, t)))
    x = fly(autopilot, guidance, plan, start, t, t + 2.0)
    assert np.linalg.norm(guidance.coordinates.place(error(guidance, plan, x, t + 2.0))) < 0.02 * before


@pytest.mark.parametrize("name", sorted(AUTOPILOTS))
def test_it_knows_where_it_will_be(name: str, flown: tuple[MissileMission, Plan]) -> None:
    guidance, plan = flown
    t, ahead = 2.0, 0.1
    for size, share in ((0.0, None), (0.05, 0.35)):
        autopilot = AUTOPILOTS[name](guidance)
        start = guidance.coordinates.state_at(plan, t) + deviation(guidance, size)
        expected = autopilot.predict(Estimate(t, start), plan, t + ahead)
        x = fly(autopilot, guidance, plan, start.copy(), t, t + ahead)
        distance = np.linalg.norm(guidance.coordinates.place(x - expected))
        moved = np.linalg.norm(guidance.coordinates.place(error(guidance, plan, x, t + ahead)))
        assert distance < (1e-4 if share is None else share * moved)


def test_the_errors_of_the_linearised_missile_decay_as_they_were_placed() -> None:
    guidance, plan = flight(PLANAR)
    autopilot, omega, t = FeedbackLinearisation(guidance, 8.0), 8.0, 1.0
    reference = guidance.coordinates.to_joints(guidance.coordinates.state_at(plan, t))
    deviated = np.array([0.5, -0.3, 0.01, 0.0, 0.0, 0.0])
    for after in (0.2, 0.5, 0.9):
        x = fly(autopilot, guidance, plan, guidance.coordinates.from_joints(reference + deviated), t, t + after)
        autopilot = FeedbackLinearisation(guidance, 8.0)
        e = guidance.coordinates.to_joints(x) - guidance.coordinates.to_joints(
            guidance.coordinates.state_at(plan, t + after)
        )
        s = omega * after
        decay = (1.0 + s - s**2) * np.exp(-s)  # of (s + omega)^3 from an error at rest, with an integral of zero
        np.testing.assert_allclose(e[:3], decay * deviated[:3], atol=0.03 * np.abs(deviated[:3]).max())


@pytest.mark.parametrize("name", CLOSED)
def test_a_wrong_mass_and_a_gust_move_it_little(name: str, flown: tuple[MissileMission, Plan]) -> None:
    guidance, plan = flown
    body = Body(1.1 * NOMINAL.mass, 1.1 * NOMINAL.inertia, 1.1 * NOMINAL.axial_inertia)
    wrench = np.array([400.0 if name.startswith("F") else 20.0 for name in guidance.coordinates.inputs])
    errors = {}
    for which in (name, "open-loop"):
        x = fly(AUTOPILOTS[which](guidance), guidance, plan, plan.x[0].copy(), 0.0, 4.0, body, wrench)
        errors[which] = np.linalg.norm(guidance.coordinates.place(error(guidance, plan, x, 4.0)))
    assert errors[name] < 0.2
    assert errors[name] < 0.01 * errors["open-loop"]


@pytest.mark.parametrize("name", CLOSED)
def test_what_the_estimator_sees_is_fed_forward(name: str, flown: tuple[MissileMission, Plan]) -> None:
    guidance, plan = flown
    t, x = 1.0, guidance.coordinates.state_at(plan, 1.0)
    beside = np.arange(1.0, len(guidance.input_max) + 1.0)
    blind = AUTOPILOTS[name](guidance).command(t, Estimate(t, x), plan)
    seeing = AUTOPILOTS[name](guidance).command(t, Estimate(t, x, extra={"disturbance": beside}), plan)
    np.testing.assert_allclose(seeing, blind - beside, rtol=0.0, atol=1e-6)


def test_the_integral_takes_away_what_lasts_and_the_regulator_does_not() -> None:
    guidance, plan = flight(PLANAR)
    wrench = np.array([0.0, 400.0, 20.0])
    errors = {
        name: np.linalg.norm(
            error(
                guidance,
                plan,
                fly(AUTOPILOTS[name](guidance), guidance, plan, plan.x[0], 0.0, 4.0, NOMINAL, wrench),
                4.0,
            )[4:]
        )
        for name in CLOSED
    }
    assert errors["feedback-linearisation"] < 0.2 * errors["tvlqr"]


def test_the_integral_does_not_wind_up_at_the_limits_of_the_thrusters() -> None:
    guidance, plan = flight(PLANAR)
    limits = np.array([3e3, 12e3, 150.0])
    bounded = dataclasses.replace(guidance, input_max=tuple(limits))
    offset = np.zeros(6)
    offset[4:] = 3.0, 3.0  # more than the thrusters make good at once
    start = guidance.coordinates.state_at(plan, 1.0) + offset
    ends = {}
    for name, knows in (("knows its limits", bounded), ("does not", guidance)):
        x = fly(FeedbackLinearisation(knows, 8.0), guidance, plan, start.copy(), 1.0, 3.0, limits=limits)
        ends[name] = np.linalg.norm(error(guidance, plan, x, 3.0)[4:])
    assert ends["knows its limits"] < 0.02
    assert ends["does not"] > 0.5  # or the test says nothing


def test_the_regulator_is_the_textbooks_where_nothing_varies() -> None:
    # Level flight with lift: A and B are constant, and far from the end the gain is that of the infinite horizon.
    weight = NOMINAL.mass * NOMINAL.gravity
    t = np.linspace(0.0, 8.0, 17)
    x = np.column_stack([np.full(17, 100.0), np.zeros((17, 3)), 100.0 * t, np.full(17, -50.0)])
    plan = Plan(t, x, np.tile([0.0, -weight, 0.0], (16, 1)), np.full(16, OPTIMISED, np.int64))
    Q, R, Q_T = np.diag([1.0, 1.0, 25.0, 1e4, 400.0, 400.0]), np.diag([1e-6, 1e-6, 1e-4]), np.eye(6)
    found = gains(plan, PLANAR, NOMINAL, Q, R, Q_T)
    h = float(found.t[1])
    x_0, u_0, step = x[0], plan.u[0], 1e-4
    F, G = np.empty((6, 6)), np.empty((6, 3))
    for k in range(6):
        by = step * np.eye(6)[k]
        F[:, k] = (PLANAR.flow(x_0 + by, u_0, h) - PLANAR.flow(x_0 - by, u_0, h)) / (2.0 * step)
    for k in range(3):
        by = 10.0 * np.eye(3)[k]
        G[:, k] = (PLANAR.flow(x_0, u_0 + by, h) - PLANAR.flow(x_0, u_0 - by, h)) / 20.0
    P = solve_discrete_are(F, G, h * Q, h * R)
    wanted = np.linalg.solve(h * R + G.T @ P @ G, G.T @ P @ F)
    np.testing.assert_allclose(found.K[0], wanted, rtol=2e-3, atol=1e-3 * np.abs(wanted).max())


def test_the_regulator_is_solved_once_for_a_plan_and_again_for_another() -> None:
    guidance, plan = flight(PLANAR)
    autopilot = TimeVaryingLQR(guidance)
    deviated = plan.x[0] + deviation(guidance, 1.0)
    first = autopilot.command(0.0, Estimate(0.0, deviated), plan)
    np.testing.assert_array_equal(autopilot.command(0.0, Estimate(0.0, deviated), plan), first)
    shorter = dataclasses.replace(plan, t=plan.t[:2], x=plan.x[:2], u=plan.u[:1], phase=plan.phase[:1])
    assert np.abs(autopilot.command(0.0, Estimate(0.0, deviated), shorter) - first).max() > 1.0


def test_after_the_end_of_the_plan_commands_stay_finite(
    autopilot: Autopilot, flown: tuple[MissileMission, Plan]
) -> None:
    guidance, plan = flown
    for late in (0.0, 0.01, 1.0):
        t = plan.t_end + late
        x = guidance.coordinates.state_at(plan, t) + deviation(guidance, 1.0)
        assert np.isfinite(autopilot.command(t, Estimate(t, x), plan)).all()


def test_a_state_of_another_size_is_refused(flown: tuple[MissileMission, Plan]) -> None:
    guidance, plan = flown
    for name in CLOSED:
        with pytest.raises(ValueError, match="shape"):
            AUTOPILOTS[name](guidance).command(1.0, Estimate(1.0, np.zeros(7)), plan)
