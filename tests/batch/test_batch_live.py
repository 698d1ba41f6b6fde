"""The live view of a batch, on terminals and in logs."""

import io
import re
import threading
from pathlib import Path

from rich.console import Console

from airrace.batch.executor import StageFinished
from airrace.batch.plan import BatchPlan, JobResult, PlannedJob
from airrace.cli.batch_tables import BatchLines, LiveTable

STEP = PlannedJob("oval", "oval", "oval.yaml", None, (), None, "the track changed")


def test_the_live_table_shows_course_stage_race_time_state_and_elapsed_time() -> None:
    written, now = io.StringIO(), [0.0]
    console = Console(file=written, force_terminal=True, width=100, height=20, no_color=True)
    view = LiveTable(console, lambda: now[0])
    view.begun(BatchPlan(Path(), (STEP,)))
    view.started(STEP, 2, "worker-1")
    view.stage_finished(STEP, StageFinished("oval", "point-mass", "solved", 55.25, True))
    now[0] = 7.0
    with console.capture() as captured:
        console.print(view.live.get_renderable())
    header, row, total = re.sub(r"\x1b\[[0-9;]*m", "", captured.get()).splitlines()
    assert header.split() == ["job", "stage", "race", "time", "s", "state", "elapsed", "s"]
    assert "oval" in row
    assert all(word in row for word in ("point-mass", "55.250", "solved (attempt 2, on worker-1)", " 7"))
    assert "0 of 1 done, 1 under way, 7 s" in total
    view.ended(STEP, JobResult(4, "cannot be reached", None, 7.0))
    with console.capture() as captured:
        console.print(view.live.get_renderable())
    assert "1 of 1 done (1 infeasible), 0 under way" in captured.get()
    assert "oval: again (the track changed)" in written.getvalue()


def test_the_live_table_never_grows_beyond_the_terminal() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=80, height=10)
    view = LiveTable(console)
    steps = [PlannedJob(f"j{number}", "x", "x.yaml", None, (), None) for number in range(50)]
    view.begun(BatchPlan(Path(), tuple(steps)))
    for step in steps:
        view.started(step, 1, "")
    with console.capture() as captured:
        console.print(view.live.get_renderable())
    assert len(captured.get().splitlines()) <= 10


def test_the_live_table_may_be_drawn_while_jobs_come_and_go() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=80, height=40)
    view = LiveTable(console)
    failed: list[BaseException] = []
    done = threading.Event()

    def draw() -> None:
        try:
            while not done.is_set():
                view.live.get_renderable()
        except BaseException as error:
            failed.append(error)

    drawing = threading.Thread(target=draw)
    drawing.start()
    for number in range(2000):
        step = PlannedJob(f"j{number % 7}", "x", "x.yaml", None, (), None)
        view.started(step, 1, "")
        view.retried(step, "crashed") if number % 3 else view.ended(step, JobResult(0))
    done.set()
    drawing.join()
    assert failed == []


def test_plain_lines_carry_time_and_count() -> None:
    written, now = io.StringIO(), [0.0]
    lines = BatchLines(written, lambda: now[0])
    lines.begun(BatchPlan(Path(), (STEP,)))
    now[0] = 12.34
    lines.ended(STEP, JobResult(0, "", 55.25, 12.0))
    assert written.getvalue().splitlines() == [
        "[    0.0 s] 1 job: 1 to fly",
        "[    0.0 s] oval: again (the track changed)",
        "[   12.3 s] oval: certified, race time 55.250 s, 12.0 s (1 of 1)",
    ]
