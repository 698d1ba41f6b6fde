"""How far something is, on a terminal and without one."""

import io

from airrace.pages.views.count_view import LINE_INTERVAL, CountView


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_the_time_left_is_that_of_the_task_and_of_those_that_follow() -> None:
    stream, clock = io.StringIO(), Clock()
    view = CountView(stream, renews=False, clock=clock)
    view.begin("wind 1 of 3", 0, 3)
    clock.now = 10.0
    view.watch(500, 1000, 20)  # 10 s for the rest, 20 s for each of two more
    view.begin("wind 2 of 3", 1, 3)
    clock.now = 30.0
    view.watch(1000, 1000, 40)
    assert stream.getvalue().splitlines() == [
        "wind 1 of 3",
        "wind 1 of 3: flights 500 of 1000, 20 break a rule, 50 s left",
        "wind 2 of 3",
        "wind 2 of 3: flights 1000 of 1000, 40 break a rule, 15 s left",
    ]


def test_without_a_terminal_lines_are_rare_and_the_last_one_comes() -> None:
    stream, clock = io.StringIO(), Clock()
    view = CountView(stream, renews=False, clock=clock)
    view.begin("flights")
    for done in range(101):
        clock.now += 0.5
        view.watch(done, 100, 0)
    lines = stream.getvalue().splitlines()
    assert len(lines) <= 1 + 101 * 0.5 / LINE_INTERVAL
    assert lines[-1].startswith("flights: flights 100 of 100")


def test_a_terminal_has_one_line_that_goes() -> None:
    stream = io.StringIO()
    view = CountView(stream, renews=True, clock=Clock())
    view.begin("a\x1b]0;name\x07")
    view.watch(1, 2, 0)
    view.close()
    assert "\n" not in stream.getvalue()
    assert stream.getvalue().endswith("\r\x1b[2K")
    assert "\x1b]" not in stream.getvalue()
