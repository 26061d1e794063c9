"""The observer between readings and at them: it stays on the truth, converges, and bears what it cannot use."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.riemannian.contraction import ContinuousObserver
from mathnavi.estimators.riemannian.gains import CurvatureName, IntrinsicGains
from mathnavi.estimators.riemannian.sampled import SampledIntrinsicObserver
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, flat_space, hyperbolic_space, sphere
from mathnavi.models.manifold.systems import PointSystem, linear
from mathnavi.sim.metrics.lagrangian import errors_of

SPACES = [sphere(3), hyperbolic_space(2), flat_space(2)]
spaces = pytest.mark.parametrize("space", SPACES, ids=lambda space: space.name)
H = 0.005


def begun(space: ConstantCurvature, speed: float, seed: int = 0) -> tuple[PointSystem, Array]:
    system, rng = PointSystem(space, linear(2.0, 0)), np.random.default_rng(seed)
    p = space.draw(rng)
    return system, system.state(p, speed * space.draw_vector(rng, p))


def errors(
    space: ConstantCurvature, gains: IntrinsicGains, eta: float, *, steps: int, h: float = H, seed: int = 0
) -> list[tuple[float, Array, float, Array]]:
    """After each reading, of an observer that starts on the point with a share ``eta`` of its velocity."""
    system, x = begun(space, 2.0, seed)
    n, u = space.size, np.zeros(space.size)
    observer = SampledIntrinsicObserver(system, gains, x[:n])
    observer.eta = eta * x[n:]
    found = []
    for _ in range(steps):
        x, _ = system.reach(x, u, h)
        observer.predict(h, u, x[:n])
        observer.correct(x[:n], h)
        found.append(errors_of(space, x, np.concatenate([observer.xi, observer.eta])))
    return found


@spaces
def test_started_on_the_truth_it_stays_there_to_the_second_order(space: ConstantCurvature) -> None:
    """Property D.1."""
    worst = [
        max(error for _, _, error, _ in errors(space, IntrinsicGains(5.0), 1.0, steps=round(2.0 / h), h=h))
        for h in (0.01, 0.005)
    ]
    assert worst[0] < 2e-3
    assert space.kappa == 0.0 or 3.0 < worst[0] / worst[1] < 5.0  # in R^n, under a constant force, it is exact


@spaces
@pytest.mark.parametrize("curvature", ["minus-one", "matched"])
def test_from_rest_it_finds_the_velocity(space: ConstantCurvature, curvature: CurvatureName) -> None:
    found = errors(space, IntrinsicGains(5.0, 1.0, "constant", curvature, space.kappa), 0.0, steps=800)
    assert found[0][2] > 1.5
    assert found[-1][2] < 1e-3
    assert found[-1][0] < 1e-4


def test_with_the_printed_gains_the_velocity_error_is_frozen() -> None:
    found = errors(sphere(3), IntrinsicGains(5.0, 1.0, "printed"), 0.0, steps=800)
    assert found[-1][0] < 0.02
    assert found[-1][2] > 0.9 * found[0][2]


def test_w_falls_along_the_repaired_observer() -> None:
    """|Delta v|^2 / 2 + 3/2 B |s|^2 - sqrt(B) <s, Delta v>, for |v| <= 3.1 sqrt(B)."""
    B = 25.0
    rows = np.array([row[3] for row in errors(sphere(3), IntrinsicGains(5.0), 0.0, steps=400)])
    W = rows[:, 0] + 3.0 * B * rows[:, 1] - math.sqrt(B) * rows[:, 2]
    large = 1e-5 * W[0] < W
    assert (np.diff(W)[large[1:]] < 0.0).all()


def test_with_gaps_the_curvature_term_does_not_throw_it_off() -> None:
    """h |eta| = 1.6: Euler's step of C R(eta, L) alone would turn every correction around."""
    space, h, none = hyperbolic_space(2), 0.4, np.zeros(3)
    system = PointSystem(space, linear(0.0, 0))
    o = space.origin
    x = system.state(o, space.vector(o, np.array([4.0, 0.0])))
    observer = SampledIntrinsicObserver(system, IntrinsicGains(5.0), o)
    observer.eta = space.vector(o, np.array([4.0, 0.05]))
    for _ in range(8):
        x, _ = system.reach(x, none, h)
        observer.predict(h, none, x[:3])
        observer.correct(x[:3], h)
    _, _, error, _ = errors_of(space, x, np.concatenate([observer.xi, observer.eta]))
    assert error < 0.1


def test_a_reading_beyond_its_share_of_the_injectivity_radius_is_refused() -> None:
    system, x = begun(sphere(3), 1.0)
    observer = SampledIntrinsicObserver(system, IntrinsicGains(5.0), x[:4], share=0.9)
    before = observer.xi.copy()
    found = observer.correct(-x[:4], H)
    assert not found.accepted
    assert found.distance == pytest.approx(math.pi, abs=1e-6)
    assert np.array_equal(observer.xi, before)
    observer.predict(H, np.zeros(4), -x[:4])  # nor is the force taken from there
    assert np.isfinite(observer.eta).all()


@spaces
def test_a_force_that_the_model_lacks_is_found(space: ConstantCurvature) -> None:
    """The potential of the truth is twice what is believed: delta is its gradient, moving with the point."""
    believed, rng = PointSystem(space, linear(2.0, 0)), np.random.default_rng(1)
    truth, p = PointSystem(space, linear(4.0, 0)), space.draw(rng)
    x, n, u = truth.state(p, space.draw_vector(rng, p)), space.size, np.zeros(space.size)
    observer = SampledIntrinsicObserver(believed, IntrinsicGains(60.0), x[:n], disturbed=True)
    plain = SampledIntrinsicObserver(believed, IntrinsicGains(60.0), x[:n])
    errors = []
    for _ in range(1500):
        x, _ = truth.reach(x, u, 0.002)
        for each in (observer, plain):
            each.predict(0.002, u, x[:n])
            each.correct(x[:n], 0.002)
        rows = [errors_of(space, x, np.concatenate([each.xi, each.eta]))[2] for each in (observer, plain)]
        errors.append(rows)
    disturbed, without = np.array(errors)[750:].max(axis=0)
    assert disturbed < 0.35 * without
    missing = truth.force(x[:n], x[n:], u) - believed.force(x[:n], x[n:], u)
    assert observer.delta is not None
    assert space.norm(x[:n], space.transport(observer.xi, x[:n], observer.delta) - missing) < 0.35 * space.norm(
        x[:n], missing
    )


@pytest.mark.parametrize("space", SPACES[:2], ids=lambda space: space.name)
def test_readings_without_end_make_it_the_continuous_observer(space: ConstantCurvature) -> None:
    """Sampled every h it is (D.6) to the first order in h."""
    gains, n = IntrinsicGains(4.0, 0.8, "constant", "minus-one", space.kappa), space.size
    apart = []
    for h in (0.004, 0.002):
        system, x = begun(space, 2.0)
        sampled, u = SampledIntrinsicObserver(system, gains, x[:n]), np.zeros(n)
        continuous = ContinuousObserver(space, gains, x[:n], np.zeros(n))
        for _ in range(round(0.5 / h)):
            middle, _ = system.reach(x, u, 0.5 * h)
            end, _ = system.reach(middle, u, 0.5 * h)
            continuous.step(h, *((z[:n], system.force(z[:n], z[n:], u)) for z in (x, middle, end)))
            sampled.predict(h, u, end[:n])
            sampled.correct(end[:n], h)
            x = end
        apart.append(space.norm(sampled.xi, sampled.eta - space.transport(continuous.xi, sampled.xi, continuous.eta)))
    assert apart[0] < 0.02
    assert 1.6 < apart[0] / apart[1] < 2.4
