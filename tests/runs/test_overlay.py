"""What the live graphic tells: what was heard, so much later, with its age, and the passings of the flight."""

import json
import math
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from example_flights import half_cuban, windy

from airrace.api.flights import follow
from airrace.errors import UsageError
from airrace.flights.results import Entrant
from airrace.flights.results.flight import NOBODY
from airrace.pages.report.film import Language
from airrace.runs.follow import follow_stream, replayed
from airrace.runs.overlay import AHEAD, Overlay, follow_with_overlay, served
from airrace.runs.stage_view import StageView

VIEW = half_cuban()["point-mass"]
assert isinstance(VIEW, StageView)
START = {name: float(VIEW.flight()[name][0]) for name in ("x", "y", "z", "V_K", "q0", "q1", "q2", "q3", "n_z")}


class Clock:
    """A clock that is set."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


def overlay(delay: float = 0.0, entrant: Entrant = NOBODY) -> tuple[Overlay, Clock]:
    clock = Clock()
    return Overlay([VIEW.flight()], entrant, Language.EN, delay, clock), clock


def told(graphic: Overlay) -> tuple[float | None, float]:
    state = graphic.state()
    clock, age = state["clock"], state["age"]
    assert isinstance(age, float)
    assert clock is None or isinstance(clock, float)
    return clock, age


@pytest.mark.parametrize("delay", [0.0, 3.0])
def test_a_state_is_told_after_the_delay_and_the_clock_runs_on_between_two(delay: float) -> None:
    graphic, clock = overlay(delay)
    for step in range(51):
        clock.now = 100.0 + 0.1 * step
        graphic.hear(40.0 + 0.1 * step, 0.1 * step, START, [0.0])
    for off in (0.0, 0.04):
        clock.now = 105.0 + off
        assert told(graphic) == (pytest.approx(5.0 - delay + off), pytest.approx(off, abs=1e-9))
    clock.now = 105.0 + delay
    assert told(graphic)[0] == pytest.approx(5.0)


def test_nothing_is_told_before_the_delay_is_over() -> None:
    graphic, clock = overlay(3.0)
    graphic.hear(0.0, 0.0, START, [0.0])
    clock.now += 2.9
    assert told(graphic) == (None, 0.0)
    clock.now += 0.2
    assert told(graphic) == (pytest.approx(0.1), pytest.approx(0.1))


def test_in_silence_the_last_state_stays_and_gets_old_and_the_next_one_is_told_at_once() -> None:
    graphic, clock = overlay()
    graphic.hear(0.0, 7.0, START, [0.0])
    clock.now += 30.0
    assert told(graphic) == (7.0 + AHEAD, pytest.approx(30.0))
    graphic.hear(30.0, 37.0, START, [0.0])
    assert told(graphic) == (37.0, 0.0)


def test_states_that_were_read_late_count_from_when_they_were_due() -> None:
    graphic, clock = overlay()
    graphic.hear(0.0, 0.0, START, [0.0])
    clock.now += 0.8
    for step in range(1, 9):
        graphic.hear(0.1 * step, 0.1 * step, START, [0.0])
        assert told(graphic)[0] == pytest.approx(0.8 if step > 2 else 0.1 * step + AHEAD)
    clock.now += 10.0  # a clock of the stream that is slower than that of the machine
    graphic.hear(0.9, 0.9, START, [0.0])
    assert told(graphic) == (pytest.approx(0.9), 0.0)


def test_before_the_start_there_is_no_clock_and_gates_are_passed_one_by_one() -> None:
    graphic, clock = overlay(1.0)
    crossings = VIEW.flight().crossings
    times = [crossing.time for crossing in crossings]
    passings: list[float] = []
    graphic.hear(-1.0, math.nan, START, passings)
    clock.now += 1.0
    state = graphic.state()
    assert state["clock"] is None
    values, shown = state["values"], state["passings"]
    assert isinstance(values, dict)
    assert values["height"] == pytest.approx(-START["z"])
    assert isinstance(shown, list)
    assert [passing["time"] for passing in shown] == [None] * len(times)
    graphic.hear(0.0, times[1] + 0.5, START, times[:2])
    graphic.hear(0.5, times[1] + 1.0, START, times)  # what comes later is not told yet
    clock.now += 1.2
    state = graphic.state()
    shown = state["passings"]
    assert isinstance(shown, list)
    assert [passing["time"] for passing in shown] == [*times[:2], *[None] * (len(times) - 2)]
    assert [passing["name"] for passing in shown] == [crossing.passage.element.name for crossing in crossings]
    assert state["race_time"] is None


# One gate of the course stands nowhere: it is where the optimum flies as it asks for.
@pytest.mark.parametrize(("flown", "off"), [(half_cuban, 0.005), (windy, 0.06)])
def test_passings_of_a_stream_are_those_of_the_flight(flown: object, off: float) -> None:
    flight = (half_cuban() if flown is half_cuban else windy()).flight()
    assert isinstance(VIEW, StageView)
    last: list[list[float]] = []

    def beyond() -> Iterator[list[bytes]]:
        """Yield the flight, and half a second beyond its finish."""
        message = b""
        for (message,) in replayed(flight, every=0.1, speed=0.0):
            yield [message]
        end = json.loads(message)
        for step in range(1, 6):
            on = {key: end[key] + 0.1 * step * end[speed] for key, speed in MOTION.items()}
            yield [json.dumps({**end, **on, "time_s": end["time_s"] + 0.1 * step}).encode()]

    def heard(at: float, clock: float, state: object, passings: list[float]) -> None:
        last[:] = [passings]

    for _ in follow_stream(VIEW, beyond(), gates=1, every=1e3, heard=heard):  # pyright: ignore[reportArgumentType]
        pass
    begin = flight.crossings[0].time
    assert last[0] == pytest.approx([crossing.time - begin for crossing in flight.crossings], abs=off)


MOTION = {"x_m": "north_m_s", "y_m": "east_m_s", "height_m": "up_m_s"}


def test_the_page_and_the_state_are_served_to_this_machine_alone_and_a_port_but_once() -> None:
    graphic, _ = overlay(entrant=Entrant("<b>Ada", "SUI"))
    with served(graphic, 0) as address:
        with urllib.request.urlopen(address) as answer:
            page = answer.read().decode()
        assert "<b>Ada" not in page
        with urllib.request.urlopen(f"{address}state") as answer:
            assert json.load(answer)["clock"] is None
        for path, host, status in (("other", None, 404), ("state", "example.org", 421)):
            request = urllib.request.Request(f"{address}{path}", headers={"Host": host} if host else {})
            with pytest.raises(urllib.error.HTTPError, match=str(status)):
                urllib.request.urlopen(request)
        port = int(address.split(":")[-1].strip("/"))
        with pytest.raises(UsageError, match="choose another"), served(graphic, port):
            pass
    with served(graphic, port):  # free again at once
        pass


def test_words_of_graphics_need_graphics_and_have_to_say_something(tmp_path: Path) -> None:
    run = half_cuban().save(tmp_path / "run.h5")
    for words in ({"delay": 3.0}, {"entrant": "name=Ada"}, {"flight": ["run.h5"]}):
        with pytest.raises(UsageError, match="add --overlay PORT"):
            follow(run, **words)
    with pytest.raises(UsageError, match=r"team=B.* known are name, nation"):
        follow(run, overlay=8765, entrant="name=Ada,team=B")


def test_a_followed_flight_tells_first_where_its_graphic_is() -> None:
    assert isinstance(VIEW, StageView)
    graphic, clock = overlay()
    answers = follow_with_overlay(graphic, 0, VIEW, replayed(VIEW.flight(), every=0.25, speed=0.0), gates=1, every=1e3)
    assert "overlay at http://127.0.0.1:" in str(next(answers)["remark"])
    rest = list(answers)
    assert all("time_s" in answer for answer in rest)
    clock.now += 1.0
    assert told(graphic)[0] == pytest.approx(VIEW.race_time, abs=0.3 + AHEAD)
