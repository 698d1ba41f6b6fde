"""Watching a run: what each kind of observer shows."""

import io
import logging
from dataclasses import replace

import pytest
from fake_optimizer import stage_result
from rich.console import Console

from airrace.pages.views.progress_lines import LINE_INTERVAL, PlainLines, outcome_line
from airrace.pages.views.progress_view import watching
from airrace.pages.views.terminal import LiveView
from airrace.procedure.result import OUTCOMES, Iteration, LowerBound, Progress, SearchReport, Status
from airrace.procedure.stage import Stage

STAGES = (Stage.HOMOTOPY, Stage.POINT_MASS)


class Clock:
    """Time that passes only when told to."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def watch_a_stage(progress: Progress) -> None:
    progress.stage_started(Stage.POINT_MASS)
    progress.activity("joint problem", 0, 0)
    progress.iteration(Iteration(7, 57.25, 1.5e-4))


def test_plain_lines_name_stages_and_hold_no_control_codes() -> None:
    stream = io.StringIO()
    lines = PlainLines(stream, STAGES)
    watch_a_stage(lines)
    lines.stage_finished(stage_result(Stage.POINT_MASS))
    lines.stage_started(Stage.SIX_DOF)
    shown = stream.getvalue()
    assert "point-mass: started (stage 2 of 2)" in shown
    assert "joint problem" in shown
    assert "race time 10.000 s" in shown
    assert shown.endswith("six-dof: started\n")
    assert not set("\x1b\r") & set(shown)


def test_plain_lines_thin_iterations_out() -> None:
    stream, clock = io.StringIO(), Clock()
    lines = PlainLines(stream, clock=clock)
    lines.stage_started(Stage.POINT_MASS)
    for number in range(100):
        clock.now = number * LINE_INTERVAL / 10.0
        lines.iteration(Iteration(number, 57.0, 1.0))
    assert stream.getvalue().count("iteration") == 9


def test_the_live_view_shows_all_there_is_to_know_of_the_present_activity() -> None:
    clock = Clock()
    console = Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)
    view = LiveView("Rovinj 2014", console, STAGES, clock)

    def shown() -> str:
        with console.capture() as capture:
            console.print(view.live.get_renderable())
        return capture.get()

    view.stage_started(Stage.HOMOTOPY)
    view.activity("phase 3 of 16: g2 -> g3", 2, 16)
    view.iteration(Iteration(42, 57.25, 1.5e-4))
    clock.now = 3.25
    for piece in ("Rovinj 2014", "homotopy, stage 1 of 2", "phase 3 of 16", "42", "57.250 s", "1.5e-04", "3.2 s"):
        assert piece in shown()
    view.activity("phase 4 of 16: g3 -> g4", 3, 16)
    assert "57.250" not in shown()


def test_stage_that_goes_on_by_prices_stays_in_the_live_view() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)
    view = LiveView("Rovinj 2014", console, STAGES, Clock())
    bound = LowerBound(0.0, 10.0, 3, 0, 0, 0, (), stopped=True)
    result = stage_result(Stage.POINT_MASS)
    shown: list[bool] = []
    for finished in (replace(result, search=SearchReport(bound=bound)), result):
        view.stage_started(Stage.POINT_MASS)
        view.stage_finished(finished)
        with console.capture() as capture:
            console.print(view.live.get_renderable())
        shown.append("point-mass, stage 2 of 2" in capture.get())
        assert outcome_line(finished).endswith("the search goes on by prices") is shown[-1]
    assert shown == [True, False]


@pytest.mark.parametrize(("columns", "width"), [(80, 76), (120, 76), (50, 50)])
def test_the_box_keeps_its_size_whatever_happens_in_it(columns: int, width: int) -> None:
    clock = Clock()
    console = Console(file=io.StringIO(), force_terminal=True, width=columns, color_system=None)
    view = LiveView("Rovinj 2014", console, STAGES, clock)

    def size() -> tuple[int, set[int]]:
        with console.capture() as capture:
            console.print(view.live.get_renderable())
        lines = capture.get().splitlines()
        return len(lines), {len(line) for line in lines}

    sizes = [size()]
    view.stage_started(Stage.HOMOTOPY)
    sizes.append(size())
    view.activity("phase 3 of 16: " + 10 * "a long name -> ", 2, 16)
    sizes.append(size())
    view.iteration(Iteration(42, 57.25, 1.5e-4))
    clock.now = 4000.0
    sizes.append(size())
    view.activity("joint problem", 0, 0)
    sizes.append(size())
    assert sizes == [(9, {width})] * 5


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


@pytest.mark.parametrize("outcome", OUTCOMES)
def test_the_line_of_a_stage_says_whether_it_is_certified(outcome: Status) -> None:
    line = outcome_line(stage_result(Stage.POINT_MASS, outcome))
    assert ("NOT certified" in line) == (outcome is not Status.SOLVED)
    assert outcome.value.lower() in line.lower()
