"""The losses by the cost to go add up, are none along an optimum, and a stream is answered with them."""

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from example_flights import half_cuban

from airrace.errors import UsageError
from airrace.flights.results import Flight
from airrace.flights.results.cost_to_go import EXIT, CostToGoLoss
from airrace.runs.cost_to_go import cost_to_go_loss
from airrace.runs.follow import follow_stream, replayed
from airrace.runs.stage_view import StageView

VIEW = half_cuban()["point-mass"]
assert isinstance(VIEW, StageView)


@pytest.fixture(scope="module")
def loss() -> CostToGoLoss:
    return cost_to_go_loss(VIEW, VIEW.flight())


def test_an_optimum_loses_nothing_anywhere(loss: CostToGoLoss) -> None:
    assert loss.total == pytest.approx(0.0, abs=1e-3)
    assert [sample.reachable for sample in loss.samples] == pytest.approx(
        [VIEW.race_time] * len(loss.samples), abs=1e-3
    )
    assert loss.costliest == ()
    gaps = np.diff([sample.moment.time for sample in loss.samples])
    assert gaps.max() < 0.55


def test_losses_of_legs_causes_and_cues_add_up(loss: CostToGoLoss) -> None:
    flight = loss.flight
    assert loss.start + sum(leg.amount for leg in loss.legs) == pytest.approx(
        flight.race_time - loss.race_time, abs=1e-9
    )
    for leg in loss.legs:
        assert sum(leg.parts.values()) == pytest.approx(leg.amount, abs=1e-9)
        assert EXIT in leg.parts
        assert sum(cue.amount for cue in leg.cues) == pytest.approx(leg.amount, abs=1e-9)
        assert leg.best.race_time == pytest.approx(VIEW.race_time, abs=2e-3)


def test_a_flight_without_a_passing_has_no_cost_to_go() -> None:
    flight = VIEW.flight()
    lost = replace(flight.crossings[1], time=float("nan"))
    incomplete = replace(flight, crossings=(flight.crossings[0], lost, *flight.crossings[2:]))
    with pytest.raises(UsageError, match="does not pass"):
        cost_to_go_loss(VIEW, incomplete)


def lines_of(flight: Flight) -> Iterator[bytes | None]:
    """Yield the states of a flight with garbage, a silence and a lie between them."""
    for number, line in enumerate(replayed(flight, every=0.25, speed=0.0)):
        yield line
        if number == 4:
            yield b"garbage"
            yield None
            yield json.dumps({**json.loads(line), "time_s": json.loads(line)["time_s"] + 0.1, "x_m": 1e5}).encode()


def test_a_stream_is_answered_and_its_faults_are_told() -> None:
    flight = VIEW.flight()
    answers = list(follow_stream(VIEW, lines_of(flight), gates=2, every=1.0))
    remarks = [str(answer["remark"]) for answer in answers if "cost_to_go_s" not in answer]
    assert len(remarks) == 3
    for words, remark in zip(("no JSON object", "no message", "a jump"), remarks, strict=True):
        assert words in remark
    states = [answer for answer in answers if "cost_to_go_s" in answer]
    assert len(states) >= int(VIEW.race_time) - 1
    for answer in states:
        best = answer["best_race_time_s"]
        assert isinstance(best, float)
        assert best == pytest.approx(VIEW.race_time, abs=0.05)  # velocity and load factor of a stream are rounded
        assert answer["line"]
