"""A batch that is interrupted or killed: what is finished is kept, and the rest is flown by the next call."""

import os
import signal
import subprocess
import threading
import time

import pytest
from batch_examples import starts
from batch_shell import Ran, Shell
from waiting import PATIENCE, text_of, wait_until_gone

from airrace.cli.batch import stopping


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
def test_a_signal_to_the_batch_and_its_group_is_one_request_and_told_once(
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
    monkeypatch.setattr("airrace.cli.batch.ONE_REQUEST", 5.0)  # a busy machine may deliver the second one late
    second = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    with stopping() as asked:
        os.kill(os.getpid(), signal.SIGINT)
        second.start()
        assert asked()
    second.join()  # the signal would end it by KeyboardInterrupt
