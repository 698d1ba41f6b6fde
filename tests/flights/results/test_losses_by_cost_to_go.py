"""The losses by the cost to go add up, are none along an optimum, and a stream is answered with them."""

import json
import math
import socket
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from example_flights import half_cuban

from airrace.errors import UsageError
from airrace.flights.results import Flight
from airrace.flights.results.cost_to_go import EXIT, CostToGoLoss
from airrace.model.frames import QUATERNION, rotation
from airrace.runs.cost_to_go import cost_to_go_loss, cost_to_go_of
from airrace.runs.follow import BACK, LOOPBACK, Follower, follow_stream, replayed, udp_port
from airrace.runs.stage_view import StageView

VELOCITIES = {"x_m": "north_m_s", "y_m": "east_m_s", "height_m": "up_m_s"}
PLACE_KEYS = ("time_s", "x_m", "y_m", "height_m")
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


def lines_of(flight: Flight) -> Iterator[list[bytes]]:
    """Yield the states of a flight with garbage, a silence and a lie between them."""
    for number, (line,) in enumerate(replayed(flight, every=0.25, speed=0.0)):
        yield [line]
        if number == 4:
            yield [b"garbage"]
            yield []
            yield [json.dumps({**json.loads(line), "time_s": json.loads(line)["time_s"] + 0.1, "x_m": 1e5}).encode()]


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


def follower() -> tuple[Follower, dict[str, float]]:
    """Return one that has seen nothing, and the optimum's state at the start."""
    rest = cost_to_go_of(VIEW)
    return Follower(rest, (), 1), rest.state_at(0.0)


def beside(start: dict[str, float], ahead: float) -> dict[str, float]:
    """Return a state so far ahead of another, m, in the same attitude."""
    direction = np.array(rotation([start[name] for name in QUATERNION]))[:, 0]
    moved = {name: start[name] + ahead * float(part) for name, part in zip("xyz", direction, strict=True)}
    return {**start, **moved}


def test_the_clock_starts_where_the_start_is_crossed() -> None:
    follow, start = follower()
    for step in range(-20, 1):
        at = 100.0 + 0.05 * step - 0.02
        follow.observe(at, beside(start, start["V_K"] * (at - 100.0)))
        assert math.isnan(follow.begins)
    for at in (100.03, 100.08, 100.13):
        follow.observe(at, beside(start, start["V_K"] * (at - 100.0)))
        assert follow.begins == pytest.approx(100.0, abs=1e-9)


def test_the_wrong_way_and_far_aside_are_no_start() -> None:
    follow, start = follower()
    q0, q1, q2, q3 = (start[name] for name in QUATERNION)
    turned = dict(zip(QUATERNION, (-q3, -q2, q1, q0), strict=True))  # about the vertical
    follow.observe(1.0, {**beside(start, 1.0), **turned})
    follow.observe(2.0, {**beside(start, 1.0), "z": start["z"] - 100.0})
    follow.observe(3.0, beside(start, 2.0 * BACK * start["V_K"]))
    assert math.isnan(follow.begins)
    follow.observe(4.0, beside(start, 1.0))
    assert follow.begins == pytest.approx(4.0 - 1.0 / start["V_K"], abs=1e-9)


def pieces(flight: Flight) -> Iterator[list[bytes]]:
    """Yield an approach, half a flight, a way round off the course, an approach again and a whole flight."""
    lines = [json.loads(line) for (line,) in replayed(flight, every=0.1, speed=0.0)]
    first, clock = lines[0], 0.0
    approach = [
        {**first, **{key: first[key] - first[speed] * away for key, speed in VELOCITIES.items()}}
        for away in np.arange(2.0, 0.0, -0.1)
    ]
    away = [{**lines[0], "x_m": first["x_m"] + 5000.0}] * 10
    for state in (*approach, *lines[: len(lines) // 2], *away, *approach, *lines):
        clock += 0.1
        yield [json.dumps({**state, "time_s": clock}).encode()]


def test_a_flight_begins_at_its_start_and_anew_behind_a_way_round() -> None:
    flight = VIEW.flight()
    answers = list(follow_stream(VIEW, pieces(flight), gates=1, every=1.0))
    waiting = [answer for answer in answers if answer.get("remark") == "before the start"]
    assert waiting
    assert all(answer.keys() == {"time_s", "remark"} for answer in waiting)
    assert any("off the course" in str(answer["remark"]) for answer in answers)
    clocks = [answer["race_clock_s"] for answer in answers if "race_clock_s" in answer]
    assert sum(np.diff(np.array(clocks, float)) < 0.0) == 1
    gaps = [answer["gap_s"] for answer in answers if "gap_s" in answer]
    assert np.array(gaps, float) == pytest.approx(0.0, abs=0.05)


def test_behind_the_finish_there_is_no_guidance_and_the_next_start_counts() -> None:
    lines = [json.loads(line) for (line,) in replayed(VIEW.flight(), every=0.1, speed=0.0)]
    last = lines[-1]
    beyond = [
        {**last, **{key: last[key] + 0.1 * step * last[speed] for key, speed in VELOCITIES.items()}}
        for step in range(1, 21)
    ]
    states = [*lines, *beyond, *lines]
    stamped = ([json.dumps({**state, "time_s": 0.1 * number}).encode()] for number, state in enumerate(states))
    answers = list(follow_stream(VIEW, stamped, gates=1, every=0.5))
    behind = [float(str(answer["time_s"])) for answer in answers if answer.get("remark") == "behind the finish"]
    assert min(behind) == pytest.approx(0.1 * len(lines), abs=0.5)
    anew = 0.1 * (len(lines) + len(beyond))
    for answer in answers:
        if "race_clock_s" in answer and float(str(answer["time_s"])) > anew:
            assert answer["race_clock_s"] == pytest.approx(float(str(answer["time_s"])) - anew, abs=0.02)
    assert "race_clock_s" in answers[-1]


def test_datagrams_that_wait_are_all_read() -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        probe.bind((LOOPBACK, 0))
        port = probe.getsockname()[1]
    batches = udp_port(port)
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sender:
        assert next(batches) == []  # bound, and silent
        for number in range(50):
            sender.sendto(str(number).encode(), (LOOPBACK, port))
        received: list[bytes] = []
        while len(received) < 50:
            batch = next(batches)
            assert batch
            received += batch
    assert received == [str(number).encode() for number in range(50)]


def test_messages_that_waited_together_are_all_read_and_one_is_answered() -> None:
    lines = [line for (line,) in replayed(VIEW.flight(), every=0.1, speed=0.0)]
    silent = [json.dumps({key: json.loads(line)[key] for key in PLACE_KEYS}).encode() for line in lines]
    answers = list(follow_stream(VIEW, [silent[:20], silent[20:30]], gates=1, every=0.5))
    assert [answer["time_s"] for answer in answers] == pytest.approx([1.9, 2.9])
    assert [answer["race_clock_s"] for answer in answers] == pytest.approx([1.9, 2.9], abs=0.02)
