"""How far a film is: one line that is written over on a terminal, elsewhere a few lines."""

import io
from collections.abc import Iterator

from airrace.pages.views.drawing_progress import DrawingProgress, duration_text
from airrace.pages.views.plain_text import SafeStream


def progress(stream: io.StringIO, *, in_place: bool) -> DrawingProgress:
    """Progress on a clock of which a second passes whenever it is read."""
    ticks: Iterator[int] = iter(range(2000))
    return DrawingProgress(
        "filming", SafeStream(stream, commanded=in_place), in_place=in_place, clock=lambda: float(next(ticks))
    )


def test_the_time_left_follows_from_the_pace_of_the_pictures() -> None:
    stream = io.StringIO()
    shown = progress(stream, in_place=True)
    for number in range(101):
        shown.show(number / 100)
    lines = [line.strip() for line in stream.getvalue().split("\r") if line.strip()]
    assert lines[0] == "filming:   0%"
    assert lines[40] == "filming:  40%, 1 min 0 s left"
    assert lines[-1] == "filming: 100%"
    assert stream.getvalue().endswith("\n")


def test_without_a_terminal_there_is_a_line_for_every_tenth() -> None:
    stream = io.StringIO()
    shown = progress(stream, in_place=False)
    shown.say("verifying the flights")
    for number in range(1001):
        shown.show(number / 1000)
    lines = stream.getvalue().splitlines()
    assert len(lines) == 12
    assert lines[0] == "verifying the flights"
    assert "\r" not in stream.getvalue()


def test_durations_are_never_shorter_than_they_are() -> None:
    assert [duration_text(seconds) for seconds in (0.2, 59.5, 60.0, 200.0)] == [
        "1 s",
        "1 min 0 s",
        "1 min 0 s",
        "3 min 20 s",
    ]
