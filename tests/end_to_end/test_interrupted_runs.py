"""A run that is stopped ends at once, keeps what is finished, and goes on later to the same race time."""

import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path

import pytest
from airrace_command import POINT_MASS, SIXTEEN, Ran, airrace, children, inside, start, wait_for
from waiting import PATIENCE, wait_until_gone

# One lap takes a few seconds: time enough to be stopped in the middle of the joint solve.
ALONE = ("course.laps=1", "settings.search=off")
ONE_LAP = tuple(word for setting in ALONE for word in ("--set", setting))
EXPLORING = ("--set", "settings.guess=plan", "--set", "course.laps=1", "--threads", "2")
linux_only = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes through /proc")


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    """The run that nobody stops."""
    ran = inside("optimize", SIXTEEN, *POINT_MASS, *ONE_LAP, "--json", cwd=tmp_path_factory.mktemp("uninterrupted"))
    assert ran.code == 0
    return ran


def interrupted(
    folder: Path, text: str, number: signal.Signals, *, after: float = 0.1, how: Sequence[str] = ONE_LAP
) -> tuple[int, str, list[int]]:
    """Start a run and stop it a moment after it has said `text`.

    Returns:
        Exit code, stdout, and the processes it had started.
    """
    with start("optimize", SIXTEEN, *POINT_MASS, *how, "--json", "--output", "run.h5", cwd=folder) as running:
        wait_for(running, text)
        time.sleep(after)
        started = children(running.pid)
        running.send_signal(number)
        out, _ = running.communicate(timeout=PATIENCE)
        return running.returncode, out, started


@linux_only
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_run_stopped_in_the_joint_solve_keeps_its_homotopy_and_goes_on_to_the_same_time(
    number: signal.Signals, tmp_path: Path, uninterrupted: Ran
) -> None:
    code, out, started = interrupted(tmp_path, "point-mass: started", number)
    assert code == 130
    assert started
    wait_until_gone(*started)
    assert Ran(code, out, "").stages == ["homotopy"]
    resumed = airrace("resume", "run.h5", *POINT_MASS, "--json", cwd=tmp_path)
    assert resumed.code == 0
    assert "homotopy: started" not in resumed.err
    assert resumed.answer["certified"] is True
    assert resumed.stages == ["homotopy", "point-mass"]
    assert resumed.race_time == pytest.approx(uninterrupted.race_time, rel=1e-6)
    assert inside("verify", "run.h5", cwd=tmp_path).code == 0


@pytest.mark.slow
def test_run_that_is_out_of_time_keeps_what_is_finished_and_goes_on_to_the_same_time(
    tmp_path: Path, uninterrupted: Ran
) -> None:
    stopped = airrace("optimize", SIXTEEN, *ONE_LAP, "--output", "run.h5", "--timeout", "0.1", "--json", cwd=tmp_path)
    assert stopped.code == 6
    assert (
        stopped.answer["error"]
        == "stopped after 0.1 s (--timeout); go on with `airrace resume run.h5` (finished: none)"
    )
    for _ in range(2):  # the first of them ends with all that was asked for, the second has nothing to do
        resumed = airrace("resume", "run.h5", *POINT_MASS, "--timeout", "900", "--json", cwd=tmp_path)
        assert resumed.code == 0
        assert resumed.race_time == pytest.approx(uninterrupted.race_time, rel=1e-9)


@pytest.mark.parametrize("seconds", ["0", "nan"])
def test_a_run_without_any_time_is_wrong_usage(seconds: str, tmp_path: Path) -> None:
    refused = airrace("optimize", SIXTEEN, "--output", "run.h5", "--timeout", seconds, cwd=tmp_path)
    assert refused.code == 2
    assert "--timeout" in refused.err
    assert not (tmp_path / "run.h5").exists()


@linux_only
@pytest.mark.slow
def test_run_stopped_in_the_homotopy_begins_again(tmp_path: Path, uninterrupted: Ran) -> None:
    code, out, started = interrupted(tmp_path, "phase 4 of 8", signal.SIGINT)
    assert code == 130
    wait_until_gone(*started)
    assert Ran(code, out, "").stages == []
    resumed = airrace("resume", "run.h5", *POINT_MASS, "--json", cwd=tmp_path)
    assert resumed.code == 0
    assert resumed.race_time == pytest.approx(uninterrupted.race_time, rel=1e-6)


@linux_only
def test_killed_run_leaves_a_checkpoint_to_go_on_with_and_no_process(tmp_path: Path, uninterrupted: Ran) -> None:
    code, _, started = interrupted(tmp_path, "point-mass: started", signal.SIGKILL)
    assert code == -signal.SIGKILL
    wait_until_gone(*started)
    assert inside("show", "run.h5", "--json", cwd=tmp_path).stages == ["homotopy"]
    resumed = inside("resume", "run.h5", *POINT_MASS, "--json", cwd=tmp_path)
    assert resumed.code == 0
    assert resumed.race_time == pytest.approx(uninterrupted.race_time, rel=1e-6)


@linux_only
def test_run_stopped_before_anything_is_finished_can_be_taken_up(tmp_path: Path) -> None:
    code, out, _ = interrupted(tmp_path, "homotopy: started", signal.SIGINT, after=0.0)
    assert (code, Ran(code, out, "").stages) == (130, [])
    planned = airrace("resume", "run.h5", *POINT_MASS, "--dry-run", "--json", cwd=tmp_path)
    steps = planned.answer["steps"]
    assert isinstance(steps, list)
    assert [(step["stage"], step["action"]) for step in steps] == [("homotopy", "run"), ("point-mass", "run")]


@linux_only
@pytest.mark.parametrize(("text", "after"), [("starts, solved coarsely", 0.5), ("other routes, 1", 0.2)])
def test_run_stopped_while_it_explores_ends_at_once_with_all_its_solvers(
    text: str, after: float, tmp_path: Path
) -> None:
    code, out, started = interrupted(tmp_path, text, signal.SIGINT, after=after, how=EXPLORING)
    assert (code, Ran(code, out, "").stages) == (130, [])
    assert len(started) == 2
    wait_until_gone(*started)


@linux_only
def test_run_stopped_by_its_prices_keeps_the_flight_of_the_quick_search(tmp_path: Path) -> None:
    thorough = (*EXPLORING, "--search", "thorough")
    code, out, started = interrupted(tmp_path, "windows between gates", signal.SIGINT, how=thorough)
    assert (code, Ran(code, out, "").stages) == (130, ["point-mass"])
    wait_until_gone(*started)
    resumed = airrace("resume", "run.h5", *POINT_MASS, "--json", cwd=tmp_path)
    assert (resumed.code, resumed.race_time) == (0, Ran(code, out, "").race_time)
    assert "started" not in resumed.err


@linux_only
def test_worker_killed_in_mid_solve_is_a_failure_of_the_system(tmp_path: Path) -> None:
    with start("optimize", SIXTEEN, *POINT_MASS, *ONE_LAP, "--json", "--output", "run.h5", cwd=tmp_path) as running:
        wait_for(running, "phase 3 of 8")
        for worker in children(running.pid):  # the one that solves, and one that was started in case of need
            os.kill(worker, signal.SIGKILL)
        out, err = running.communicate(timeout=PATIENCE)
    assert running.returncode == 8
    assert "solver process died" in str(Ran(8, out, err).answer["error"])
    assert "Traceback" not in err
