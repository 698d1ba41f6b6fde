"""The error falls with the order of the integrator: of the integrator by itself, and of an optimum found with it."""

import numpy as np
import pytest
from convergence import MESHES, SCHEMES, integration_errors, observed_order, optimum_errors, order_of_optima

from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RungeKutta

every_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)


@every_scheme
def test_integration_error_falls_with_the_order_of_the_scheme(scheme: RungeKutta) -> None:
    assert observed_order(integration_errors, scheme) == pytest.approx(scheme.order, abs=0.2)


@every_scheme
def test_error_of_an_optimum_falls_with_the_order_of_the_scheme(scheme: RungeKutta) -> None:
    assert observed_order(optimum_errors, scheme) == pytest.approx(order_of_optima(scheme), abs=0.2)


def test_a_symmetric_growth_flatters_an_odd_order() -> None:
    """Why the growth that is measured is not symmetric."""
    errors = np.array(optimum_errors(DORMAND_PRINCE_5, [16, 32, 64], reached=0.9))
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(6.0, abs=0.1)


@every_scheme
def test_two_steps_in_an_interval_are_one_step_in_each_half(scheme: RungeKutta) -> None:
    errors = np.array(integration_errors(scheme, [2 * intervals for intervals in MESHES[:3]]))
    doubled = RungeKutta("doubled", scheme.order, scheme.a, scheme.b, steps=2 * scheme.steps)
    assert np.array(integration_errors(doubled, MESHES[:3])) == pytest.approx(errors, rel=1e-9)
