"""Gusts against the formulas of MIL-F-8785C: intensities, spectra, variances, and the histories that are drawn."""

import numpy as np
import pytest

from airrace.flights.safety.disturbances import Gusts
from airrace.flights.safety.plant import STATIONARY_GUSTS, GustFilter, intensity
from airrace.optimal_control.quantities import FOOT, KNOT

STEP = 0.02


def filters(count: int = 10, *, height: float = 20.0, speed: float = 100.0) -> GustFilter:
    """The filters of moderate gusts in level flight."""
    return GustFilter.of(Gusts.MODERATE, np.full(count, height), np.full(count, speed), STEP)


def test_intensities_and_lengths_are_those_of_the_specification() -> None:
    """At 1000 ft all are alike: 1 / (0.177 + 0.823) = 1."""
    sigma, length = intensity(Gusts.LIGHT, np.array([1000.0, 2000.0]) * FOOT)
    np.testing.assert_allclose(sigma, 1.5 * KNOT)
    np.testing.assert_allclose(length, 1000.0 * FOOT)
    sigma, length = intensity(Gusts.SEVERE, np.array([20.0]) * FOOT)
    assert sigma[2, 0] == pytest.approx(4.5 * KNOT)
    assert sigma[0, 0] == pytest.approx(4.5 * KNOT / (0.177 + 0.01646) ** 0.4)
    assert length[1, 0] == pytest.approx(20.0 * FOOT / (0.177 + 0.01646) ** 1.2)
    assert length[2, 0] == pytest.approx(20.0 * FOOT)


def test_the_filters_keep_the_stationary_covariance_and_put_out_the_variances() -> None:
    one = filters()
    kept = one.step[0] @ STATIONARY_GUSTS @ one.step[0].T + one.noise[0] @ one.noise[0].T
    np.testing.assert_allclose(kept, STATIONARY_GUSTS, atol=1e-14)
    sigma, _ = intensity(Gusts.MODERATE, np.array([20.0]))
    np.testing.assert_allclose(np.diag(one.output[0] @ STATIONARY_GUSTS @ one.output[0].T), sigma[:, 0] ** 2)


def test_autocovariances_are_those_of_the_dryden_spectra() -> None:
    """Of u: exp(-t); of v and w: exp(-t) (1 - t / 2), with t the time over T [the Fourier transform of the spectra]."""
    one, lag = filters(), 7
    sigma, length = intensity(Gusts.MODERATE, np.array([20.0]))
    after = np.linalg.matrix_power(one.step[0], lag) @ STATIONARY_GUSTS
    t = lag * STEP * 100.0 / length[:, 0]
    expected = sigma[:, 0] ** 2 * np.exp(-t) * np.array([1.0, 1.0 - 0.5 * t[1], 1.0 - 0.5 * t[2]])
    np.testing.assert_allclose(np.diag(one.output[0] @ after @ one.output[0].T), expected, rtol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_spectra_are_those_of_the_formula(axis: int) -> None:
    """Sampled finely, the spectrum of the discrete filter is that of the specification, s^2 2L/(pi V) / (1 + ...)."""
    fine = GustFilter.of(Gusts.LIGHT, np.full(1, 20.0), np.full(1, 90.0), 1e-4)
    sigma, length = intensity(Gusts.LIGHT, np.array([20.0]))
    T = length[axis, 0] / 90.0
    for omega in (0.1 / T, 1.0 / T, 3.0 / T):
        z = np.exp(1j * omega * 1e-4)
        transfer = fine.output[0][axis] @ np.linalg.solve(z * np.eye(5) - fine.step[0], fine.noise[0])
        found = 1e-4 / np.pi * np.sum(np.abs(transfer) ** 2)  # one-sided, per rad/s
        a = (omega * T) ** 2
        shape = 2.0 / (1.0 + a) if axis == 0 else (1.0 + 3.0 * a) / (1.0 + a) ** 2
        assert found == pytest.approx(sigma[axis, 0] ** 2 * T / np.pi * shape, rel=2e-3)


def test_drawn_histories_have_these_variances_and_correlations() -> None:
    one = filters(3000)
    drawn = one.draw([np.random.default_rng([5, number]) for number in range(60)])
    sigma, _ = intensity(Gusts.MODERATE, np.array([20.0]))
    np.testing.assert_allclose(drawn.std(axis=(0, 2)), sigma[:, 0], rtol=0.05)
    assert abs(np.mean(drawn[:, 0] * drawn[:, 1])) < 0.05 * sigma[0, 0] * sigma[1, 0]
    assert drawn[0].std(axis=1) == pytest.approx(sigma[:, 0], rel=0.3)  # from the very start


def test_a_history_is_the_same_beside_others() -> None:
    one = filters(200)
    alone = one.draw([np.random.default_rng([1, 4])])
    among = one.draw([np.random.default_rng([1, number]) for number in range(9)])
    assert (alone[:, :, 0] == among[:, :, 4]).all()


def test_without_gusts_nothing_blows() -> None:
    calm = GustFilter.of(Gusts.NONE, np.full(5, 20.0), np.full(5, 100.0), STEP)
    assert not calm.draw([np.random.default_rng(0)]).any()
