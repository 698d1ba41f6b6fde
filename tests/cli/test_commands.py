"""The commands, flown by a canned procedure: what they print, write and return."""

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import fake_optimizer
import pytest
from command import Ran, run
from waiting import PATIENCE

from airrace.files.checkpoint import read_checkpoint, write_checkpoint
from airrace.files.inputs import load_inputs
from airrace.runs.execute import run_lock

ROOT = Path(__file__).parents[2]
TRACK = ROOT / "tracks" / "rovinj_2014.yaml"
PASSINGS = [passage.name for passage in load_inputs(TRACK).race.course.passages]
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")


class Shell:
    """`airrace` in a folder of its own."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        self._monkeypatch = monkeypatch

    def __call__(self, *arguments: str | Path, scenario: str = "certified") -> Ran:
        self._monkeypatch.setenv("FAKE_SCENARIO", scenario)
        return run(*arguments)


@pytest.fixture
def airrace(fake_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Shell:
    return Shell(fake_folder, monkeypatch)


@pytest.fixture
def run_file(airrace: Shell) -> Path:
    """A finished run."""
    assert airrace("optimize", TRACK, "--quiet").code == 0
    return airrace.folder / "rovinj_2014.h5"


def stages(path: Path) -> list[str]:
    return [stored.result.stage.value for stored in read_checkpoint(path).stages]


def test_a_run_is_kept_under_the_name_of_its_track(airrace: Shell) -> None:
    ran = airrace("optimize", TRACK)
    assert ran.code == 0
    assert stages(airrace.folder / "rovinj_2014.h5") == ["homotopy", "point-mass"]
    assert "1:g0#2" in ran.out
    assert ran.out.startswith("point-mass: 10.000 s, certified: local optimum\n")
    assert "point-mass: solved, certified" in ran.err
    assert not CONTROL.search(ran.out + ran.err)
    ran = airrace("optimize", TRACK, "--json", "--force")
    assert ran.code == 0
    assert list(ran.answer) == ["track", "certified", "race_time_s", "wall_s", "stages"]
    assert (ran.answer["track"], ran.answer["certified"]) == ("rovinj_2014", True)
    ran = airrace("optimize", TRACK, "--quiet", "--force")
    assert (ran.code, ran.out, ran.err) == (0, "", "")


@pytest.mark.parametrize(
    ("scenario", "code"),
    [
        ("loose", 5),
        ("not certified", 5),
        ("not converged", 5),
        ("infeasible", 4),
        ("timeout", 6),
        ("crash", 8),
        ("memory", 8),
        ("invalid", 3),
        ("bug", 1),
        ("interrupt", 130),
    ],
)
def test_each_failure_has_its_code_and_keeps_the_finished_stages(airrace: Shell, scenario: str, code: int) -> None:
    ran = airrace("optimize", TRACK, "--json", scenario=scenario)
    assert ran.code == code
    assert ran.answer["certified"] is False
    assert ran.answer["error"]
    assert ran.answer["findings"] == []
    assert "Traceback" not in ran.err
    assert stages(airrace.folder / "rovinj_2014.h5")[0] == "homotopy"
    assert ran.err.splitlines()[-1] == f"airrace: {ran.answer['error']}"


def test_a_run_that_is_out_of_time_says_how_to_go_on_though_its_last_stage_is_a_guess(airrace: Shell) -> None:
    ran = airrace("optimize", TRACK, "--timeout", "30", "--json", scenario="out of time")
    how = "go on with `airrace resume rovinj_2014.h5` (finished: homotopy)"
    assert (ran.code, ran.answer["error"]) == (6, f"stopped after 30 s (--timeout); {how}")
    assert ran.answer["certified"] is False


def test_an_existing_output_is_refused_before_the_track_is_even_read(airrace: Shell) -> None:
    output = airrace.folder / "run.h5"
    output.write_text("precious")
    for track in (TRACK, Path("nowhere.yaml")):
        ran = airrace("optimize", track, "--output", output, "--json")
        assert ran.code == 2
        assert "--force" in str(ran.answer["error"])
    assert output.read_text() == "precious"
    assert airrace("optimize", TRACK, "--output", output, "--force", "--quiet").code == 0
    assert stages(output) == ["homotopy", "point-mass"]
    ran = airrace("optimize", TRACK, "--output", airrace.folder / "nowhere" / "run.h5")
    assert ran.code == 8
    assert "started" not in ran.err
    assert airrace("optimize", TRACK, "--output", airrace.folder).code == 2


def test_an_invalid_track_lists_its_findings(airrace: Shell) -> None:
    broken = airrace.folder / "broken.yaml"
    broken.write_text(TRACK.read_text(encoding="utf-8").replace("heading_deg", "heading_dge"), encoding="utf-8")
    for command in ("optimize", "check"):
        ran = airrace(command, broken, "--json")
        assert ran.code == 3
        findings = ran.answer["findings"]
        assert {"file", "line", "column", "key", "message"} == set(findings[0])
        assert f"{broken}:{findings[0]['line']}" in ran.err
    assert not (airrace.folder / "broken.h5").exists()


@pytest.mark.parametrize("option", ["--until", "--from"])
def test_an_unknown_stage_is_answered_with_the_available_ones(airrace: Shell, run_file: Path, option: str) -> None:
    ran = airrace("resume", run_file, option, "six-dof", "--json")
    assert ran.code == 2
    assert "homotopy, point-mass" in str(ran.answer["error"])


def test_a_run_until_the_homotopy_is_not_certified_and_not_verified(airrace: Shell) -> None:
    ran = airrace("optimize", TRACK, "--until", "homotopy", "--json")
    assert ran.code == 5
    assert stages(airrace.folder / "rovinj_2014.h5") == ["homotopy"]
    assert airrace("verify", airrace.folder / "rovinj_2014.h5").code == 5


def test_guess_and_set_reach_the_settings(airrace: Shell) -> None:
    arguments = ("--guess", "plan", "--set", "settings.regularisation=1e-3", "--set", "rules.n_z_max=9", "--quiet")
    assert airrace("optimize", TRACK, *arguments).code == 0
    stored = read_checkpoint(airrace.folder / "rovinj_2014.h5").inputs
    assert stored.overrides == ("settings.regularisation=1e-3", "rules.n_z_max=9", "settings.guess=plan")
    resolved = json.loads(stored.resolved)
    assert resolved["settings"]["guess"] == "plan"
    assert resolved["settings"]["regularisation"] == pytest.approx(1e-3)


def test_resume_runs_what_is_missing_and_ends_as_if_never_interrupted(airrace: Shell) -> None:
    assert airrace("optimize", TRACK, "--quiet", scenario="interrupt").code == 130
    run_file = airrace.folder / "rovinj_2014.h5"
    assert stages(run_file) == ["homotopy"]
    ran = airrace("resume", run_file, "--json")
    assert ran.code == 0
    assert ran.answer["certified"] is True
    assert stages(run_file) == ["homotopy", "point-mass"]
    assert "homotopy: started" not in ran.err
    assert "point-mass: started" in ran.err
    ran = airrace("resume", run_file)
    assert ran.code == 0
    assert "started" not in ran.err


def steps(ran: Ran) -> dict[str, str]:
    return {step["stage"]: step["action"] for step in ran.answer["steps"]}


@pytest.mark.parametrize("seconds", ["nan", "0", "-1"])
def test_a_dry_run_refuses_a_time_that_the_real_call_refuses(airrace: Shell, run_file: Path, seconds: str) -> None:
    for words in (("optimize", TRACK, "--output", "new.h5"), ("resume", run_file, "--from", "point-mass")):
        dry, real = (airrace(*words, "--timeout", seconds, *how) for how in (("--dry-run",), ()))
        assert (dry.code, dry.err) == (real.code, real.err)
        assert (dry.code, "leaves none" in dry.err) == (2, True)


def test_a_dry_run_refuses_a_run_that_another_process_solves(airrace: Shell, run_file: Path) -> None:
    before = run_file.read_bytes()
    with run_lock(run_file):
        dry = airrace("resume", run_file, "--from", "point-mass", "--dry-run")
    assert dry.code == 2
    assert run_file.read_bytes() == before


def test_a_dry_run_says_what_would_run_and_changes_nothing(airrace: Shell, run_file: Path) -> None:
    before = run_file.read_bytes()
    assert steps(airrace("resume", run_file, "--dry-run", "--json")) == {"homotopy": "keep", "point-mass": "keep"}
    again = airrace("resume", run_file, "--dry-run", "--from", "homotopy", "--json")
    assert steps(again) == {"homotopy": "run", "point-mass": "run"}
    said = airrace("resume", run_file, "--dry-run", "--from", "point-mass").out
    assert said == "homotopy: keep\npoint-mass: run (asked for)\n"
    ran = airrace("resume", run_file, "--from", "point-mass", "--until", "homotopy", "--json")
    assert ran.code == 2
    assert "point-mass comes after homotopy, the last stage: nothing would run" in ran.answer["error"]
    assert run_file.read_bytes() == before


def test_a_run_that_went_without_the_homotopy_is_not_sent_back_to_it(airrace: Shell, run_file: Path) -> None:
    checkpoint = read_checkpoint(run_file)
    without = replace(checkpoint, stages=()).with_stage(checkpoint.stages[-1].result)
    write_checkpoint(run_file, without)
    assert steps(airrace("resume", run_file, "--dry-run", "--json")) == {"point-mass": "keep"}


def test_a_stage_that_failed_is_run_again(airrace: Shell) -> None:
    assert airrace("optimize", TRACK, "--quiet", scenario="loose").code == 5
    run_file = airrace.folder / "rovinj_2014.h5"
    assert "point-mass: run (it is not certified)" in airrace("resume", run_file, "--dry-run").out
    assert airrace("resume", run_file, "--quiet").code == 0


def test_show_prints_the_object_of_the_run(airrace: Shell, run_file: Path) -> None:
    ran = airrace("show", run_file, "--json")
    assert ran.code == 0
    run = ["track", "certified", "race_time_s", "wall_s", "stages"]
    assert list(ran.answer) == [*run, "verified"]
    assert ran.answer["race_time_s"] == pytest.approx(10.0)
    shown = airrace("show", run_file).out
    assert shown.startswith("point-mass: 10.000 s, certified: local optimum; verified\n")
    assert "1:g1" in shown
    for option, piece in (("--certificate", "kkt_error"), ("--stages", "homotopy"), ("--all", "homotopy")):
        assert piece not in shown
        assert piece in airrace("show", run_file, option).out
    assert "certificate: certified (Solve_Succeeded)" in airrace("show", run_file, "--certificate").out


def test_verify_believes_only_what_it_measures(airrace: Shell, run_file: Path) -> None:
    ran = airrace("verify", run_file, "--json")
    assert ran.code == 0
    assert ran.answer["verified"] is True
    ran = airrace("verify", run_file, "--json", scenario="loose")
    assert ran.code == 5
    assert ran.answer["verified"] is False
    assert "kkt_error" in str(ran.answer["error"])


def test_where_no_flight_was_found_no_race_time_is_claimed(airrace: Shell) -> None:
    ran = airrace("optimize", TRACK, scenario="infeasible")
    assert "10.000" not in ran.out + ran.err.splitlines()[-2]
    run_file = airrace.folder / "rovinj_2014.h5"
    answered = airrace("show", run_file, "--json").answer
    assert answered["race_time_s"] is None
    assert answered["certified"] is False
    stored = answered["stages"]
    assert [stage["message"] for stage in stored] == ["", "gate g1 cannot be reached"]
    assert "point-mass: gate g1 cannot be reached" in airrace("show", run_file).out
    replayed = airrace("verify", run_file)
    assert replayed.code in (4, 5)
    assert "infeasible" in replayed.err


def test_export_writes_the_mesh_or_a_fixed_rate_and_the_splits_beside_it(airrace: Shell, run_file: Path) -> None:
    for arguments, rows in (((), 33), (("--rate", "2"), 21)):
        ran = airrace("export", "csv", run_file, *arguments)
        assert ran.code == 0
        table = list(csv.DictReader(line for line in io.StringIO(ran.out) if not line.startswith("#")))
        assert len(table) == rows
        assert {"time_s", "x_m", "V_K_m_s"} <= set(table[0])
    for wrong in (("--rate", "-1"), ("--stage", "six-dof"), ("--splits", "--rate", "5")):
        assert airrace("export", "csv", run_file, *wrong).code == 2
    assert airrace("export", "csv", run_file, "--output", "lap.csv").code == 0
    splits = Path("lap.splits.csv").read_text()
    assert splits == airrace("export", "csv", run_file, "--splits").out
    assert [row["passage"] for row in csv.DictReader(io.StringIO(splits))] == PASSINGS
    assert airrace("export", "csv", run_file, "--output", "lap.csv").code == 2
    assert airrace("export", "csv", run_file, "--output", "lap.csv", "--force").code == 0


def test_check_prints_every_passage_and_flies_nothing(airrace: Shell) -> None:
    names = [passage.name for passage in load_inputs(TRACK).race.course.passages]
    ran = airrace("check", TRACK, "--json")
    assert ran.code == 0
    passages = ran.answer["passages"]
    assert [passage["passage"] for passage in passages] == names
    shown = airrace("check", TRACK).out
    assert all(f"\n{name} " in shown for name in names)
    assert list(airrace.folder.iterdir()) == []


def start(folder: Path, *arguments: str | Path, scenario: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, fake_optimizer.__file__, *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "FAKE_SCENARIO": scenario, "FORCE_COLOR": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_at_once_and_keeps_what_is_finished(tmp_path: Path, number: signal.Signals) -> None:
    with start(tmp_path, "optimize", TRACK, "--json", scenario="slow") as running:
        assert running.stderr is not None
        while "point-mass: started" not in running.stderr.readline():
            assert running.poll() is None
        running.send_signal(number)
        out, err = running.communicate(timeout=PATIENCE)
    assert running.returncode == 130
    assert [stage["stage"] for stage in json.loads(out)["stages"]] == ["homotopy"]
    assert "airrace resume rovinj_2014.h5" in err
    assert stages(tmp_path / "rovinj_2014.h5") == ["homotopy"]


@pytest.mark.parametrize(
    "arguments", [("optimize", TRACK, "--guess", "luck"), ("resume",), ("show", "run.h5", "--loud"), ("fly", TRACK)]
)
def test_a_command_called_wrongly_is_answered_with_an_object_too(
    tmp_path: Path, arguments: Sequence[str | Path]
) -> None:
    with start(tmp_path, *arguments, "--json", scenario="certified") as running:
        out, err = running.communicate(timeout=PATIENCE)
    assert running.returncode == 2
    answered = json.loads(out)
    assert answered["error"]
    assert answered["error"] in err
    assert answered["findings"] == []


def test_without_a_terminal_there_are_no_control_codes(tmp_path: Path) -> None:
    with start(tmp_path, "optimize", TRACK, scenario="certified") as running:
        out, err = running.communicate(timeout=PATIENCE)
    assert running.returncode == 0
    assert "point-mass: solved, certified" in err
    assert not CONTROL.search(out + err)


@pytest.mark.parametrize("form", [(), ("--json",), ("--plot", "-")])
def test_a_reader_that_leaves_early_hears_no_complaint(tmp_path: Path, form: Sequence[str]) -> None:
    with start(tmp_path, "check", TRACK, *form, scenario="certified") as running:
        assert running.stdout is not None
        running.stdout.close()
        assert running.stderr is not None
        assert running.stderr.read() == ""
    assert running.returncode == 0
