"""Watching a run: what each kind of observer shows."""

import io
import logging

import pytest
from canned_procedure import stage_result
from rich.console import Console

from airrace.procedure.progress import Iteration, Progress
from airrace.procedure.result import Outcome, Stage
from airrace.views.live import LINE_INTERVAL, LiveView, PlainLines, outcome_line, watching


class Clock:
    """Time that passes only when told to."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def watch_a_stage(progress: Progress) -> None:
    progress.stage_started(Stage.POINT_MASS)
    progress.activity("joint problem", 0, 0)
    progress.iteration(Iteration(7, 57.25, 1.5e-4))


def test_plain_lines_tell_stages_and_hold_no_control_codes() -> None:
    stream = io.StringIO()
    lines = PlainLines(stream)
    watch_a_stage(lines)
    lines.stage_finished(stage_result(Stage.POINT_MASS))
    shown = stream.getvalue()
    assert "point-mass: started" in shown
    assert "joint problem" in shown
    assert "race time 10.000 s" in shown
    assert "\x1b" not in shown
    assert "\r" not in shown


def test_plain_lines_thin_iterations_out() -> None:
    stream, clock = io.StringIO(), Clock()
    lines = PlainLines(stream, clock)
    lines.stage_started(Stage.POINT_MASS)
    for number in range(100):
        clock.now = number * LINE_INTERVAL / 10.0
        lines.iteration(Iteration(number, 57.0, 1.0))
    assert stream.getvalue().count("iteration") == 9


def test_the_live_view_shows_all_there_is_to_know() -> None:
    clock = Clock()
    console = Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)
    view = LiveView("Rovinj 2014", console, clock)
    view.stage_started(Stage.HOMOTOPY)
    view.activity("phase 3 of 16: g2 -> g3", 2, 16)
    view.iteration(Iteration(42, 57.25, 1.5e-4))
    clock.now = 3.25
    with console.capture() as capture:
        console.print(view.live.get_renderable())
    shown = capture.get()
    for piece in ("Rovinj 2014", "homotopy", "phase 3 of 16", "42", "57.250 s", "1.5e-04", "3.2 s"):
        assert piece in shown


def test_a_new_activity_forgets_the_iterations_of_the_old_one() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)
    view = LiveView("t", console)
    watch_a_stage(view)
    view.activity("phase 4 of 16: g3 -> g4", 3, 16)
    with console.capture() as capture:
        console.print(view.live.get_renderable())
    assert "57.250" not in capture.get()


def test_quiet_shows_nothing_not_even_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    with watching("t", quiet=True) as progress:
        watch_a_stage(progress)
        logging.getLogger("airrace.optimal_control").warning("no compiler")
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "")


def test_without_a_terminal_progress_is_plain_whatever_the_environment_forces(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    with watching("t", quiet=False) as progress:
        watch_a_stage(progress)
        logging.getLogger("airrace.optimal_control").warning("no compiler")
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "point-mass: started" in printed.err
    assert "warning: no compiler" in printed.err
    assert "\x1b" not in printed.err


@pytest.mark.parametrize("outcome", Outcome)
def test_the_line_of_a_stage_says_whether_it_is_certified(outcome: Outcome) -> None:
    line = outcome_line(stage_result(Stage.POINT_MASS, outcome))
    assert ("NOT certified" in line) == (outcome is not Outcome.SOLVED)
    assert outcome.value.lower() in line.lower()
