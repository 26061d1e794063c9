"""The observers of the text: their errors obey the equations that are printed for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from mathnavi.estimators.textbook.observers import (
    Example22,
    Example22Config,
    KazantzisKravaris,
    KazantzisKravarisConfig,
    OutputInjection,
    OutputInjectionConfig,
)
from mathnavi.interfaces.observer_properties import Rate
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.textbook.library import (
    EXAMPLE_2_1,
    EXAMPLE_2_2,
    KAZANTZIS_KRAVARIS,
    KRENER_ISIDORI,
    error_dynamics,
)
from mathnavi.models.textbook.maps import of_numbers
from mathnavi.models.textbook.power_series import solved
from mathnavi.models.textbook.system import System
from tests.textbook import Step, mission, replayed, steps

OSCILLATION = list(steps(KRENER_ISIDORI, 4.0))
SWING = list(steps(KAZANTZIS_KRAVARIS, 4.0))


def errors(plugin: type, config: object, system: System, duration: float = 4.0) -> tuple[Array, Array]:
    """Times (k,) and errors (k, n)."""
    given = {KRENER_ISIDORI: OSCILLATION, KAZANTZIS_KRAVARIS: SWING}.get(system) or list(steps(system, duration))
    estimates = replayed(plugin.build(config, mission(system)), given)
    assert {estimate.status for estimate in estimates} == {Status.OK}
    return np.array([step.t for step in given]), np.array(
        [e.x - s.truth for e, s in zip(estimates, given, strict=True)]
    )


@pytest.mark.parametrize(("alpha", "beta"), [(2.0, 3.0), (6.0, 1.0), (1.0, -0.4), (-0.3, 1.0)])
def test_the_error_of_example_2_2_is_that_of_its_linear_equation(alpha: float, beta: float) -> None:
    t, e = errors(Example22, Example22Config(alpha, beta), EXAMPLE_2_2)
    expected = np.array([expm(at * error_dynamics(alpha, beta)) @ np.array(EXAMPLE_2_2.start_error) for at in t])
    np.testing.assert_allclose(e, expected, atol=3e-6)
    falls = bool(np.abs(e[-1, :2]).max() < np.abs(e[0, :2]).max())
    assert falls == (alpha > 0.0 and beta > 0.0)
    declared = Example22.properties(Example22Config(alpha, beta)).rate
    assert declared is (Rate.EXPONENTIAL if falls else Rate.NONE)


def test_the_error_in_the_coordinates_of_output_injection_is_linear() -> None:
    form = KRENER_ISIDORI.form
    assert form is not None
    to_z, poles = of_numbers(form.T_1, 2), (-1.5, -4.0)
    observer = OutputInjection.build(OutputInjectionConfig(poles), mission(KRENER_ISIDORI))
    estimates = replayed(observer, OSCILLATION)
    matrix = form.A - form.gain(poles) @ form.C
    e = np.array([est.extra["z"] - to_z(s.truth) for est, s in zip(estimates, OSCILLATION, strict=True)])
    expected = np.array([expm(step.t * matrix) @ e[0] for step in OSCILLATION])
    np.testing.assert_allclose(e, expected, atol=2e-6)


def test_the_error_of_kazantzis_and_kravaris_is_linear_to_the_order_of_the_series() -> None:
    deviations = []
    for order in (3, 9):
        config = KazantzisKravarisConfig(order=order)
        to_z = of_numbers(solved(KAZANTZIS_KRAVARIS, config.poles, order), 2)
        estimates = replayed(KazantzisKravaris.build(config, mission(KAZANTZIS_KRAVARIS)), SWING)
        e = np.array([est.extra["z"] - to_z(step.truth) for est, step in zip(estimates, SWING, strict=True)])
        expected = np.exp(np.outer([step.t for step in SWING], config.poles)) * e[0]
        deviations.append(np.abs(e - expected).max())
    assert deviations[1] < 1e-5
    assert deviations[1] < 0.05 * deviations[0]


@pytest.mark.parametrize("system", [KRENER_ISIDORI, KAZANTZIS_KRAVARIS], ids=lambda system: system.name)
def test_with_its_sign_put_right_equation_2_4_is_the_same_observer(system: System) -> None:
    _, in_z = errors(KazantzisKravaris, KazantzisKravarisConfig("z"), system)
    _, in_x = errors(KazantzisKravaris, KazantzisKravarisConfig("corrected"), system)
    np.testing.assert_allclose(in_x, in_z, atol=2e-5)
    assert np.linalg.norm(in_x[-1]) < 5e-3 * np.linalg.norm(in_x[0])


@pytest.mark.parametrize("system", [KRENER_ISIDORI, KAZANTZIS_KRAVARIS], ids=lambda system: system.name)
def test_as_printed_equation_2_4_leads_away_and_says_so(system: System) -> None:
    given = OSCILLATION if system is KRENER_ISIDORI else SWING
    estimates = replayed(KazantzisKravaris.build(KazantzisKravarisConfig("printed"), mission(system)), given)
    e = np.array([estimate.x - step.truth for estimate, step in zip(estimates, given, strict=True)])
    assert np.linalg.norm(e[-1]) > 3.0 * np.linalg.norm(e[0])
    assert estimates[-1].status is Status.DEGRADED
    assert estimates[-1].message == "disagrees with its readings"
    assert KazantzisKravaris.properties(KazantzisKravarisConfig("printed")).rate is Rate.NONE


OBSERVERS = [
    (Example22, Example22Config(), EXAMPLE_2_2),
    (OutputInjection, OutputInjectionConfig(), KRENER_ISIDORI),
    *((KazantzisKravaris, KazantzisKravarisConfig(form), KRENER_ISIDORI) for form in ("z", "corrected")),
    *((KazantzisKravaris, KazantzisKravarisConfig(form), KAZANTZIS_KRAVARIS) for form in ("z", "corrected")),
]


@pytest.mark.parametrize(("plugin", "config", "system"), OBSERVERS)
def test_started_on_the_truth_it_stays_there(plugin: type, config: object, system: System) -> None:
    """Property 2.1. (2.4) as printed has it, too, but is so unstable that round-off leads it away."""
    given = list(steps(system, 1.5))
    observer = plugin.build(config, mission(system, [0.0] * len(system.states)))
    deviations = [np.abs(e.x - s.truth).max() for e, s in zip(replayed(observer, given), given, strict=True)]
    assert max(deviations) < 2e-6


@pytest.mark.parametrize(
    ("plugin", "system", "allowed"),
    [
        (Example22, KRENER_ISIDORI, "example-2-2"),
        (OutputInjection, EXAMPLE_2_2, "krener-isidori"),
        (KazantzisKravaris, EXAMPLE_2_1, "one without inputs"),
    ],
)
def test_a_system_that_it_is_not_made_for_is_refused(plugin: type, system: System, allowed: str) -> None:
    with pytest.raises(ValueError, match=f"system = '{system.name}'; allowed.*{allowed}"):
        plugin.build(plugin.Config(), mission(system))


def test_lost_readings_are_bridged_by_a_copy_of_the_system() -> None:
    observer = Example22.build(Example22Config(), mission(EXAMPLE_2_2, (0.0, 0.0, 0.0)))
    given = [
        replace(step, measurements=() if 1.0 < step.t < 2.0 else step.measurements) for step in steps(EXAMPLE_2_2, 5.2)
    ]
    estimates = replayed(observer, given)
    assert max(np.abs(e.x - s.truth).max() for e, s in zip(estimates, given, strict=True)) < 1e-4
    assert {e.status for e, s in zip(estimates, given, strict=True) if 1.55 < s.t < 1.95} == {Status.LOST}
    after = [e.status for e, s in zip(estimates, given, strict=True) if s.t > 1.995]
    assert [after[0], after[290], after[-1]] == [Status.DEGRADED, Status.DEGRADED, Status.OK], "three time constants"


def test_an_observer_that_leaves_every_bound_is_lost_and_finite() -> None:
    """With alpha and beta so wrong that its error grows by e^400 in ten seconds."""
    observer = Example22.build(Example22Config(-1600.0, 0.0), mission(EXAMPLE_2_2))
    estimates = replayed(observer, list(steps(EXAMPLE_2_2, 2.0)))
    assert all(np.isfinite(estimate.x).all() for estimate in estimates)
    assert estimates[-1].status is Status.LOST


def test_a_state_without_an_image_is_lost_and_bridged() -> None:
    """Readings that are wholly wrong drive z to where T has no inverse near by; it finds back and is doubted longer."""
    config = KazantzisKravarisConfig(poles=(-20.0, -30.0))
    observer = KazantzisKravaris.build(config, mission(KAZANTZIS_KRAVARIS))
    wrong = [
        replace(s, measurements=(Measurement("output", s.t, np.array([40.0])),)) if 0.5 < s.t < 1.0 else s
        for s in SWING
    ]
    estimates = replayed(observer, wrong)
    assert all(np.isfinite(estimate.x).all() for estimate in estimates)
    assert Status.LOST in {e.status for e, s in zip(estimates, wrong, strict=True) if 0.5 < s.t < 1.0}
    assert estimates[-1].status is Status.LOST
    assert np.abs(estimates[-1].x - SWING[-1].truth).max() < 1e-2


@pytest.mark.parametrize(
    ("plugin", "config", "system"),
    [
        (Example22, Example22Config(), EXAMPLE_2_2),
        (OutputInjection, OutputInjectionConfig(), KRENER_ISIDORI),
        (KazantzisKravaris, KazantzisKravarisConfig(), KAZANTZIS_KRAVARIS),
        (KazantzisKravaris, KazantzisKravarisConfig(form="corrected"), KAZANTZIS_KRAVARIS),
    ],
)
def test_the_covariance_is_that_of_the_errors(plugin: type, config: object, system: System) -> None:
    rng, noise, nees = np.random.default_rng(8), 0.01, []
    given = {KRENER_ISIDORI: OSCILLATION, KAZANTZIS_KRAVARIS: SWING}.get(system) or list(steps(system, 4.0))
    for _ in range(4):
        read = [
            replace(
                step,
                measurements=tuple(
                    Measurement(y.name, y.t, y.value + noise * rng.standard_normal(len(y.value)))
                    for y in step.measurements
                ),
            )
            for step in given
        ]
        estimates = replayed(plugin.build(config, mission(system, noise=noise)), read)
        assert {estimate.status for estimate in estimates[1:]} == {Status.OK}
        for estimate, step in list(zip(estimates, given, strict=True))[250::10]:
            e = system.difference(estimate.x, step.truth)
            nees.append(e @ np.linalg.solve(estimate.covariance, e) / len(e))
    assert 0.3 < np.mean(nees) < 2.0


def test_an_observer_whose_readings_are_of_another_system_is_degraded() -> None:
    far = [
        replace(step, measurements=(Measurement("output", step.t, step.measurements[0].value + 3.0 * (step.t > 2.0)),))
        for step in SWING
    ]
    observer = KazantzisKravaris.build(KazantzisKravarisConfig(poles=(-0.37, -0.71)), mission(KAZANTZIS_KRAVARIS))
    statuses = [estimate.status for estimate in replayed(observer, far)]
    assert set(statuses[:200]) == {Status.OK}
    assert Status.DEGRADED in statuses[202:]


@pytest.mark.parametrize(
    ("plugin", "config", "given"),
    [
        (OutputInjection, OutputInjectionConfig(), OSCILLATION),
        (KazantzisKravaris, KazantzisKravarisConfig(), SWING),
    ],
)
def test_readings_that_are_missing_for_less_than_the_timeout_raise_no_alarm(
    plugin: type, config: object, given: list[Step]
) -> None:
    """The last reading is of an older state, which the output has left since."""
    read = [replace(step, measurements=()) if 2.0 <= step.t < 2.4 else step for step in given]
    system = KRENER_ISIDORI if given is OSCILLATION else KAZANTZIS_KRAVARIS
    assert {estimate.status for estimate in replayed(plugin.build(config, mission(system)), read)} == {Status.OK}
