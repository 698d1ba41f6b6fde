"""What the choice of a scheme means to the models that it integrates; orders are tested in `tests/validation`."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, VERNER_7, RungeKutta
from airrace.procedure.fidelities import LONGEST_INTERVAL

ROLL_MODE = 0.08  # s, its time constant


def left_of_a_mode(scheme: RungeKutta, step: float) -> float:
    """Difference to the true decay in one step."""

    def decay(y: NDArray[np.float64], _u: object, _p: object) -> NDArray[np.float64]:
        return -y / ROLL_MODE

    after = scheme.advance(decay, np.ones(1), None, None, step)
    return abs(float(after[0]) - math.exp(-step / ROLL_MODE))


@pytest.mark.parametrize(("scheme", "expected"), [(VERNER_7, 3e-5), (DORMAND_PRINCE_5, 1e-2)])
def test_the_longest_interval_is_short_enough_for_the_scheme_of_order_7_alone(
    scheme: RungeKutta, expected: float
) -> None:
    assert left_of_a_mode(scheme, LONGEST_INTERVAL) == pytest.approx(expected, rel=0.1)
