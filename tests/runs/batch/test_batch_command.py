"""`airrace batch`, its jobs flown by stand-ins: what it prints, writes and returns."""

import csv
import io
import os
import re
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest
from batch_examples import Shell, starts, write_course
from command import Ran
from junitparser import JUnitXml
from rich.console import Console
from waiting import PATIENCE, text_of, wait_until_gone

from airrace.cli.batch import stopping
from airrace.cli.batch_output import BatchLines, LiveTable
from airrace.errors import InputError, UsageError
from airrace.runs.batch import optimize_many
from airrace.runs.batch.planning import BatchPlan, JobResult, PlannedJob
from airrace.runs.batch.record import lock_folder
from airrace.runs.batch.reports import STATES
from airrace.runs.batch.supervision import StageFinished
from airrace.runs.command_result import ExitCode


def test_all_jobs_are_flown_and_shown_fastest_first(airrace: Shell) -> None:
    ran = airrace("oval.yaml", "--sweep", "environment.wind.speed_kt=5,0", "--set", "environment.wind.from_deg=0")
    assert ran.code == 0
    lines = [line.split() for line in ran.out.splitlines() if line.startswith("oval,")]
    assert [line[:5] for line in lines] == [
        ["oval,speed_kt=0", "certified", "point-mass", "10.000", "best"],
        ["oval,speed_kt=5", "certified", "point-mass", "10.500", "+0.500"],
    ]
    assert "+0.1000 s per knot" in ran.out
    assert "(2 of 2)" in ran.err
    assert "\x1b" not in ran.err + ran.out


def test_a_second_call_flies_only_what_has_changed_and_says_why(airrace: Shell) -> None:
    dry = airrace("oval.yaml", "--sweep", "notes=a,b", "--dry-run", "--json")
    assert dry.code == 0
    assert [(job["name"], job["action"], job["reason"]) for job in dry.answer["jobs"]] == [
        ("oval,notes=a", "fly", "new"),
        ("oval,notes=b", "fly", "new"),
    ]
    assert dry.answer["counts"] == {"fly": 2, "keep": 0, "refuse": 0}
    assert not airrace.out.exists()
    first = airrace("oval.yaml", "--json").answer
    second = airrace("oval.yaml", "--json").answer
    assert starts(airrace.out, "oval") == ["new"]
    assert [first["jobs"][0]["kept"], second["jobs"][0]["kept"]] == [False, True]
    for key in ("race_time_s", "stages", "state"):
        assert first["jobs"][0][key] == second["jobs"][0][key]
    course = airrace.folder / "oval.yaml"
    course.write_text(course.read_text().replace("n_z_max: 10", "n_z_max: 9"))
    dry = airrace("oval.yaml", "--dry-run")
    assert dry.out.splitlines() == ["oval: fly (the track changed)", "1 job: 1 to fly"]
    assert "oval: again (the track changed)" in airrace("oval.yaml").err
    assert starts(airrace.out, "oval") == ["new", "resumed"]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("--csv", "oval.yaml"), 2, "oval.yaml is read by this command"),
        (("--junit", "batch/oval.json"), 2, "is another file that this command writes"),
        (("--csv", "a.csv", "--markdown", "a.csv"), 2, "is another file that this command writes"),
        (("--csv", "nowhere/a.csv"), 8, "cannot write to the folder nowhere"),
        (("--output", "oval.yaml"), 2, "oval.yaml is not a folder"),
        (("--output", "oval.yaml/in"), 2, "oval.yaml/in is not a folder"),
        (("--timeout", "nan"), 2, "--timeout"),
    ],
)
def test_a_dry_run_refuses_what_the_real_call_refuses_and_makes_nothing(
    airrace: Shell, words: tuple[str, ...], code: int, said: str
) -> None:
    before = set(airrace.folder.iterdir())
    dry = airrace("oval.yaml", *words, "--dry-run")
    assert dry.code == code
    assert said in dry.err
    assert set(airrace.folder.iterdir()) == before
    real = airrace("oval.yaml", *words)
    assert (real.code, real.err) == (dry.code, dry.err)


def test_a_report_in_the_folder_that_the_batch_makes_is_no_fault_of_a_dry_run(airrace: Shell) -> None:
    assert airrace("oval.yaml", "--csv", "batch/table.csv", "--dry-run").code == 0
    assert not airrace.out.exists()


def test_a_job_may_take_any_time(airrace: Shell) -> None:
    ran = airrace("oval.yaml", "--timeout", "inf", "--json")
    assert (ran.code, ran.states) == (0, {"oval": "certified"})


@pytest.mark.parametrize(
    ("notes", "code"),
    [
        ("fine", 0),
        ("fine,infeasible", 4),
        ("infeasible,hang", 6),
        ("hang,not-certified", 5),
        ("not-certified,crash,fine", 8),
    ],
)
@pytest.mark.usefixtures("impatient")
def test_the_exit_code_is_that_of_the_worst_job(notes: str, code: int, airrace: Shell) -> None:
    ran = airrace("oval.yaml", "--sweep", f"notes={notes}", "--timeout", "60", "--json")
    assert ran.code == code
    assert ran.answer["certified"] is (code == 0)
    assert len(ran.answer["jobs"]) == len(notes.split(","))


def test_every_state_has_its_exit_code() -> None:
    assert set(STATES) == {int(code) for code in ExitCode} - {int(ExitCode.USAGE)}


def test_a_broken_file_among_many_is_reported_also_to_github_and_the_others_are_flown(
    airrace: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = write_course(airrace.folder, "broken")
    broken.write_text(broken.read_text().replace("n_z_max", "n_z_mx"))
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(airrace.folder / "summary.md"))
    ran = airrace("*.yaml", "--json")
    assert ran.code == 3
    assert ran.states == {"oval": "certified", "broken": "invalid input"}
    assert ran.answer["counts"] == {"certified": 1, "invalid input": 1}
    assert "broken.yaml:5:" in ran.err
    assert "did you mean `n_z_max`?" in ran.err
    (finding,) = ran.answer["findings"]
    assert (finding["file"], finding["line"], finding["key"]) == ("broken.yaml", 5, "rules.n_z_mx")
    assert "::error file=broken.yaml,line=5,col=" in ran.err
    assert "| oval | certified | point-mass | 10.000 | best |" in (airrace.folder / "summary.md").read_text()


def test_two_jobs_with_one_file_are_refused_before_anything_starts(airrace: Shell) -> None:
    write_course(airrace.folder / "other", "oval")
    ran = airrace("oval.yaml", "other/oval.yaml", "--json")
    assert ran.code == 2
    assert "oval.yaml" in ran.answer["error"]
    assert "other/oval.yaml" in ran.answer["error"]
    assert not list(airrace.out.glob("*.starts"))


def test_the_reports_are_written_and_replaced_by_the_next_call(airrace: Shell) -> None:
    for _ in range(2):
        reports = ("--csv", "a.csv", "--junit", "a.xml", "--markdown", "a.md")
        assert airrace("oval.yaml", "--sweep", "notes=fine,infeasible", *reports).code == 4
    table = list(csv.DictReader(io.StringIO((airrace.folder / "a.csv").read_text())))
    assert [line["state"] for line in table] == ["certified", "infeasible"]
    assert JUnitXml.fromfile(str(airrace.folder / "a.xml")).failures == 2
    assert "| oval,notes=infeasible | infeasible |" in (airrace.folder / "a.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        (("--csv", "a", "--junit", "./a"), 2, "another file that this command writes"),
        (("--csv", "oval.yaml"), 2, "is read by this command"),
        (("--csv", "batch/oval.h5"), 2, "another file that this command writes"),
        (("--csv", "nowhere/a.csv"), 8, "cannot write"),
        (("--junit", "."), 2, "is a folder"),
        (("--output", "oval.yaml"), 2, "is not a folder"),
        (("--sweep", "environment.wind.speed_kt=1:2:-1"), 3, "never arrives"),
        (("--sweep", "nonsense"), 3, "key=values"),
        (("--settings", "nowhere.yaml"), 3, "no such file"),
        (("--until", "landing"), 2, "no stage"),
        (("nothing*.yaml",), 3, "no file matches"),
    ],
)
def test_what_cannot_work_is_said_before_anything_is_flown(
    arguments: tuple[str, ...], code: int, word: str, airrace: Shell
) -> None:
    ran = airrace("oval.yaml", *arguments)
    assert ran.code == code
    assert word in ran.err
    if "*" not in arguments[0]:
        assert not list(airrace.folder.rglob("*.starts"))
    assert "schema:" in (airrace.folder / "oval.yaml").read_text()


def test_quiet_says_nothing_about_success_and_a_retry_is_reported_with_its_reason(airrace: Shell) -> None:
    ran = airrace("oval.yaml", "--quiet")
    assert (ran.code, ran.out, ran.err) == (0, "", "")
    ran = airrace("oval.yaml", "--set", "notes=crash-once", "--force", "--json")
    (job,) = ran.answer["jobs"]
    assert job["retries"] == ["its process crashed (SIGABRT)"]
    assert "oval: tried again: its process crashed (SIGABRT)" in ran.err


def test_failed_jobs_are_flown_again_when_asked_for(airrace: Shell) -> None:
    arguments = ("oval.yaml", "--sweep", "notes=fine,infeasible")
    airrace(*arguments)
    assert airrace(*arguments).code == 4
    assert airrace(*arguments, "--retry-failed").code == 4
    assert len(starts(airrace.out, "oval,notes=fine")) == 1
    assert len(starts(airrace.out, "oval,notes=infeasible")) == 2
    assert airrace(*arguments, "--force").code == 4
    assert starts(airrace.out, "oval,notes=fine") == ["new", "new"]


def test_two_batches_in_one_folder_are_refused(airrace: Shell) -> None:
    with lock_folder(airrace.out):
        ran = airrace("oval.yaml")
    assert ran.code == 2
    assert "another batch" in ran.err
    assert airrace("oval.yaml").code == 0
    with lock_folder(airrace.out), pytest.raises(UsageError), lock_folder(airrace.out):
        pass


STEP = PlannedJob("oval", "oval", "oval.yaml", None, (), None, "the track changed")


def test_the_live_table_shows_course_stage_race_time_state_and_elapsed_time() -> None:
    written, now = io.StringIO(), [0.0]
    console = Console(file=written, force_terminal=True, width=100, height=20, no_color=True)
    view = LiveTable(console, lambda: now[0])
    view.on_begin(BatchPlan(Path(), (STEP,)))
    view.on_start(STEP, 2, "worker-1")
    view.on_stage_end(STEP, StageFinished("oval", "point-mass", "solved", 55.25, True))
    now[0] = 7.0
    with console.capture() as captured:
        console.print(view.live.get_renderable())
    header, row, total = re.sub(r"\x1b\[[0-9;]*m", "", captured.get()).splitlines()
    assert header.split() == ["job", "stage", "race", "time", "s", "state", "elapsed", "s"]
    assert "oval" in row
    assert all(word in row for word in ("point-mass", "55.250", "solved (attempt 2, on worker-1)", " 7"))
    assert "0 of 1 done, 1 under way, 7 s" in total
    view.on_end(STEP, JobResult(4, "cannot be reached", None, 7.0))
    with console.capture() as captured:
        console.print(view.live.get_renderable())
    assert "1 of 1 done (1 infeasible), 0 under way" in captured.get()
    assert "oval: again (the track changed)" in written.getvalue()


def test_the_live_table_never_grows_beyond_the_terminal_and_may_be_drawn_while_jobs_come_and_go() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=80, height=10)
    view = LiveTable(console)
    steps = [PlannedJob(f"j{number}", "x", "x.yaml", None, (), None) for number in range(50)]
    view.on_begin(BatchPlan(Path(), tuple(steps)))
    for step in steps:
        view.on_start(step, 1, "")
    with console.capture() as captured:
        console.print(view.live.get_renderable())
    assert len(captured.get().splitlines()) <= 10
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
        step = steps[number % 7]
        view.on_start(step, 1, "")
        view.on_retry(step, "crashed") if number % 3 else view.on_end(step, JobResult(0))
    done.set()
    drawing.join()
    assert failed == []


def test_plain_lines_carry_time_and_count() -> None:
    written, now = io.StringIO(), [0.0]
    lines = BatchLines(written, lambda: now[0])
    lines.on_begin(BatchPlan(Path(), (STEP,)))
    now[0] = 12.34
    lines.on_end(STEP, JobResult(0, "", 55.25, 12.0))
    assert written.getvalue().splitlines() == [
        "[    0.0 s] 1 job: 1 to fly",
        "[    0.0 s] oval: again (the track changed)",
        "[   12.3 s] oval: certified, race time 55.250 s, 12.0 s (1 of 1)",
    ]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_batch_keeps_what_is_finished_and_goes_on_later(number: signal.Signals, airrace: Shell) -> None:
    arguments = ("oval.yaml", "--sweep", "notes=fine,hang-once,slow", "--jobs", "1", "--csv", "a.csv", "--json")
    with airrace.start(*arguments) as running:
        wait_for(running, "notes=hang-once: point-mass started")
        running.send_signal(number)
        out, _ = running.communicate(timeout=PATIENCE)
    assert running.returncode == 130
    assert Ran(130, out, "").states == {
        "oval,notes=fine": "certified",
        "oval,notes=hang-once": "interrupted",
        "oval,notes=slow": "interrupted",
    }
    assert (airrace.folder / "a.csv").exists()
    assert airrace(*arguments).code == 0
    assert starts(airrace.out, "oval,notes=fine") == ["new"]
    assert starts(airrace.out, "oval,notes=hang-once") == ["new", "resumed"]


def test_a_second_interrupt_ends_everything_at_once(airrace: Shell) -> None:
    """Even a job that does not listen, which the first one would leave the whole of its grace."""
    with airrace.start("oval.yaml", "--set", "notes=deaf") as running:
        wait_for(running, "point-mass started")
        child = int(text_of(airrace.out / "oval.child"))
        running.send_signal(signal.SIGINT)
        time.sleep(0.5)
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=PATIENCE)
    assert running.returncode == 130
    job = int((airrace.out / "oval.starts").read_text().split()[0])
    wait_until_gone(job, child)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_the_batch_and_its_group_is_one_request_and_reported_once(
    number: signal.Signals, airrace: Shell
) -> None:
    """`timeout` and others signal a process and then its group; the job hears the signal as well."""
    with airrace.start("oval.yaml", "--set", "notes=hang-once", "--csv", "a.csv") as running:
        wait_for(running, "point-mass started")
        os.kill(int((airrace.out / "oval.starts").read_text().split()[0]), number)
        for _ in range(2):
            running.send_signal(number)
            time.sleep(0.02)
        _, err = running.communicate(timeout=PATIENCE)
    assert running.returncode == 130
    told = [line for line in err.splitlines() if line.startswith("airrace: ")]
    assert told == ["airrace: not all jobs are certified: 1 interrupted; the same command goes on"]
    assert (airrace.folder / "a.csv").exists()


def test_what_was_under_way_when_the_parent_was_killed_is_flown_again(airrace: Shell) -> None:
    arguments = ("oval.yaml", "--sweep", "notes=fine,hang-once", "--jobs", "1")
    with airrace.start(*arguments) as running:
        wait_for(running, "notes=hang-once: point-mass started")
        os.kill(running.pid, signal.SIGKILL)
        running.communicate(timeout=PATIENCE)
    for line in (airrace.out / "oval,notes=hang-once.starts").read_text().splitlines():
        os.kill(int(line.split()[0]), signal.SIGKILL)  # a stand-in does not mind its parent
    ran = airrace(*arguments)
    assert ran.code == 0
    assert "oval,notes=hang-once: again (it was not finished)" in ran.err
    assert starts(airrace.out, "oval,notes=fine") == ["new"]


def wait_for(running: subprocess.Popen[str], text: str) -> None:
    """Read the progress until a line holds the text; what follows is read on, so that nobody waits for a reader."""
    assert running.stderr is not None
    for line in running.stderr:
        if text in line:
            return
    raise AssertionError(f"ended with {running.wait()} before it said {text!r}")


def test_second_signal_of_one_request_interrupts_nothing_though_the_jobs_have_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("airrace.cli.batch.ONE_REQUEST", 2.0)  # a busy machine may deliver the second one late
    second = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    with stopping() as asked:
        os.kill(os.getpid(), signal.SIGINT)
        second.start()
        assert asked()
    second.join()  # the signal would end it by KeyboardInterrupt


def test_python_flies_the_same_jobs_by_the_same_words(airrace: Shell) -> None:
    wind = {"environment.wind.speed_kt": ["5", "0"], "environment.wind.from_deg": "0:0:1"}
    results = optimize_many("oval.yaml", winds={"speed_kt": [5, 0], "from_deg": [0]}, set={"notes": "fine"})
    assert [(one.swept["environment.wind.speed_kt"], one.race_time) for one in results] == [("0", 10.0), ("5", 10.5)]
    assert all(one.certified and one.checkpoint is not None and one.checkpoint.exists() for one in results)
    again = optimize_many(["oval.yaml"], sweep=wind, set=["notes=fine"])
    assert [one.step.action for one in again] == ["keep", "keep"]
    shell = airrace(*("oval.yaml", "--sweep", "environment.wind.speed_kt=5,0", "--set", "notes=fine", "--json"))
    assert set(shell.answer["jobs"][0]) == set(results[0].as_object())


def test_python_returns_jobs_that_fail_and_refuses_patterns_that_mean_nothing(airrace: Shell) -> None:
    (result,) = optimize_many("oval.yaml", set={"notes": "infeasible"}, jobs=1, retries=0)
    assert (result.state, result.race_time, result.certified) == ("infeasible", None, False)
    (refused,) = optimize_many("oval.yaml", set={"rules.n_z_mx": 3})
    assert (refused.state, refused.checkpoint) == ("invalid input", None)
    with pytest.raises(InputError):
        optimize_many("nothing*.yaml")
