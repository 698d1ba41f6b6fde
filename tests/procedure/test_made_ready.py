"""What a stage needs that no other stage has to be flown for: it can be made before, and is made once."""

import pytest
from races import SMALL, settings

from airrace.control.inner_controller import InnerLoopInverse
from airrace.control.simulation import TrackingSimulator, pilot
from airrace.dynamics.flight_model import FlightModel
from airrace.procedure import fidelity_continuation as module
from airrace.procedure.fidelity_continuation import FidelityContinuation
from airrace.procedure.settings import GuessKind
from airrace.procedure.stage import Stage


@pytest.mark.parametrize(
    ("stage", "simulations"),
    [
        (Stage.POINT_MASS, 0),
        (Stage.TRANSFER_FUNCTION, 1),
        (Stage.STATE_SPACE, 0),  # it flies the equations of the stage below
        (Stage.SIX_DOF, 1),
    ],
)
def test_models_that_are_simulated_are_put_under_their_controllers_once(
    stage: Stage, simulations: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[FlightModel] = []

    def watched(model: FlightModel, inverse: InnerLoopInverse) -> TrackingSimulator:
        made.append(model)
        return pilot(model, inverse)

    monkeypatch.setattr(module, "pilot", watched)
    ladder = FidelityContinuation(SMALL, settings(GuessKind.PLAN), ())
    for _ in range(2):
        ladder.make_ready(stage)
    assert len(made) == simulations
    assert all(model is ladder.flight(stage).model for model in made)
