"""What a system demands of its declarations, and observations put side by side."""

import casadi as ca
import numpy as np
import pytest

from airrace.quantities import Quantity
from airrace.system import Observation, System, side_by_side

x, a, b = ca.SX.sym("x", 2), ca.SX.sym("a"), ca.SX.sym("b", 2)
SUM = Observation("sum", (Quantity("s", "m"),), (Quantity("a", "m"),), ca.Function("sum", [x, a], [x[0] + x[1] + a]))
SCALED = Observation(
    "scaled",
    (Quantity("v", "m"), Quantity("w", "m")),
    (Quantity("b", "1"), Quantity("c", "1")),
    ca.Function("scaled", [x, b], [x * b]),
)


def test_side_by_side_every_observation_sees_with_its_own_parameters() -> None:
    both = side_by_side(SUM, SCALED)
    assert [one.name for one in both.quantities] == ["s", "v", "w"]
    assert len(both.parameters) == 3
    assert np.asarray(both.values([1.0, 2.0], [10.0, 3.0, 4.0])).ravel() == pytest.approx([13.0, 3.0, 8.0])


def test_side_by_side_no_name_means_two_quantities() -> None:
    with pytest.raises(ValueError, match="sum and sum both observe s"):
        side_by_side(SUM, SUM)


@pytest.mark.parametrize("moved", ["v", "rate"])
def test_system_refuses_the_rate_of_what_is_no_state(moved: str) -> None:
    u = ca.SX.sym("u")
    with pytest.raises(ValueError, match=f"rate is declared to be the rate of {moved}, which is no state"):
        System(
            name="lost",
            states=(Quantity("s", "m"),),
            controls=(Quantity("rate", "m/s", rate_of=moved),),
            parameters=(),
            rates=ca.Function("rates", [ca.SX.sym("x"), u, ca.SX(0, 1)], [u]),
        )
