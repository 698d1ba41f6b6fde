"""Runs that are started from another run, flown by a canned procedure: what is asked, refused, said and written."""

import dataclasses
from pathlib import Path

import fake_optimizer
import pytest
from command import run as airrace

from airrace.files.checkpoint import read_checkpoint, write_checkpoint
from airrace.files.inputs import load_inputs
from airrace.procedure import procedure
from airrace.procedure.result import Status
from airrace.procedure.stage import Stage
from airrace.runs.run_state import run_of_checkpoint

TRACKS = Path(__file__).parents[2] / "tracks"
TRACK = TRACKS / "rovinj_2014.yaml"
CHANGE = ("--set", "rules.n_z_max=8")
PASSINGS = [passage.name for passage in load_inputs(TRACK).race.course.passages]


@pytest.fixture
def run_file(fake_folder: Path) -> Path:
    """A finished run, with an override of its own."""
    assert airrace("optimize", TRACK, "--set", "rules.n_z_max=9", "--output", "RUN.h5", "--quiet").code == 0
    return fake_folder / "RUN.h5"


def rules(path: Path) -> tuple[float, float]:
    """The load factor and the height that a stored run allows."""
    allowed = run_of_checkpoint(read_checkpoint(path), path).inputs.race.course.rules
    return allowed.n_z.upper, allowed.height.lower


def test_changes_come_on_top_of_what_was_stored_and_the_difference_is_reported_leg_by_leg(run_file: Path) -> None:
    before = run_file.read_bytes()
    ran = airrace("resume", run_file, "--set", "rules.floor_m=12", "--output", "NEW.h5", "--json")
    assert ran.code == 0
    assert run_file.read_bytes() == before
    assert rules(Path("NEW.h5")) == (9.0, 12.0)
    compared = ran.answer["compared"]
    (flight,) = compared["flights"]
    assert (compared["reference"]["label"], flight["label"]) == ("RUN.h5:point-mass", "NEW.h5:point-mass")
    assert (compared["reference"]["race_time_s"], flight["race_time_s"], flight["difference_s"]) == (10.0, 10.0, 0.0)
    assert [leg["passing"] for leg in flight["legs"]] == PASSINGS[1:]
    said = airrace("resume", run_file, *CHANGE, "--output", "NEW.h5", "--force")
    assert "NEW.h5:point-mass against RUN.h5:point-mass: a tie within" in said.out
    assert said.out.splitlines()[-2].startswith("next: ")
    ran = airrace("optimize", TRACK, "--start", run_file, "--output", "NEW.h5", "--force", "--json")
    assert ran.code == 0
    assert "compared" in ran.answer


def test_file_with_changes_replaces_the_stored_text(run_file: Path) -> None:
    Path("moved.yaml").write_text(TRACK.read_text().replace("east_m: 434.3", "east_m: 444.3"))
    assert airrace("resume", run_file, "--track", "moved.yaml", "--output", "NEW.h5", "--quiet").code == 0
    new = read_checkpoint(Path("NEW.h5")).inputs
    assert "444.3" in new.track.text
    assert new.aircraft == read_checkpoint(run_file).inputs.aircraft
    assert rules(Path("NEW.h5"))[0] == 9.0  # stored overrides hold for the new text as well


def test_dry_run_says_what_would_be_started_from_what_and_writes_nothing(run_file: Path) -> None:
    ran = airrace("resume", run_file, "--set", "rules.n_z_max=8", "--output", "NEW.h5", "--dry-run")
    assert (ran.code, ran.out.strip()) == (0, "point-mass: run (started from the one of RUN.h5)")
    assert not Path("NEW.h5").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        pytest.param(CHANGE, "--output NEW.h5", id="no file for the new run"),
        pytest.param((*CHANGE, "--output", "RUN.h5", "--force"), "is read by this command", id="the same file"),
        pytest.param((*CHANGE, "--output", "taken.h5"), "overwrite it with --force", id="an existing file"),
        pytest.param(("--output", "NEW.h5"), "say with --set", id="no change"),
        pytest.param((*CHANGE, "--output", "NEW.h5", "--from", "point-mass"), "--from", id="a stage again"),
        pytest.param(
            (*CHANGE, "--output", "NEW.h5", "--until", "homotopy"), "or solved stage up to", id="nothing so low"
        ),
    ],
)
def test_options_that_do_not_go_together_are_refused(run_file: Path, options: tuple[str, ...], said: str) -> None:
    Path("taken.h5").write_bytes(b"taken")
    before = run_file.read_bytes()
    ran = airrace("resume", run_file, *options)
    assert ran.code == 2
    assert said in ran.err
    assert ran.err.count("\n") == 1
    assert run_file.read_bytes() == before
    assert Path("taken.h5").read_bytes() == b"taken"
    assert not Path("NEW.h5").exists()


def test_course_with_other_passings_and_a_change_that_is_none_are_refused(run_file: Path) -> None:
    ran = airrace("optimize", TRACKS / "abu_dhabi_2016.yaml", "--start", run_file, "--output", "NEW.h5")
    assert ran.code == 2
    assert "number 5 is 1:g4" in ran.err or "number 7 is 1:g6" in ran.err
    ran = airrace("resume", run_file, "--set", "rules.n_z_max=often", "--output", "NEW.h5")
    assert ran.code == 3
    assert not Path("NEW.h5").exists()


@pytest.mark.parametrize("content", [b"", b"not a checkpoint\n"])
def test_damaged_file_is_no_start(run_file: Path, content: bytes) -> None:
    run_file.write_bytes(content)
    for ran in (
        airrace("optimize", TRACK, "--start", run_file, "--output", "NEW.h5"),
        airrace("resume", run_file, *CHANGE, "--output", "NEW.h5"),
    ):
        assert ran.code == 7
        assert ran.err.count("\n") == 1
        assert not Path("NEW.h5").exists()


def test_run_without_a_certified_stage_is_no_start(run_file: Path) -> None:
    run = read_checkpoint(run_file)
    failed = fake_optimizer.stage_result(Stage.POINT_MASS, Status.NOT_CERTIFIED)
    write_checkpoint(run_file, run.with_stage(failed))
    ran = airrace("resume", run_file, *CHANGE, "--output", "NEW.h5")
    assert ran.code == 2
    assert "RUN.h5 has no certified or solved stage up to point-mass to start from" in ran.err
    write_checkpoint(run_file, dataclasses.replace(run, stages=()))
    ran = airrace("resume", run_file, *CHANGE, "--output", "NEW.h5")
    assert ran.code == 2
    assert "no finished stage" in ran.err


def test_run_of_another_version_is_a_start_and_it_is_said(run_file: Path) -> None:
    run = read_checkpoint(run_file)
    write_checkpoint(run_file, dataclasses.replace(run, versions={**run.versions, "casadi": "0.0"}))
    ran = airrace("resume", run_file, *CHANGE, "--output", "NEW.h5", "--quiet")
    assert ran.code == 0
    assert "written with casadi 0.0" in ran.err
    assert "certified anew" in ran.err


def test_run_without_lower_stages_is_kept_as_it_stands_and_needs_them_to_be_computed_again(run_file: Path) -> None:
    run = read_checkpoint(run_file)
    highest = run.stages[-1].result  # alone, as if the run had been started from another one
    source = dataclasses.replace(highest.provenance, source_stage=highest.stage.value, source_run="other.h5")
    alone = dataclasses.replace(run, stages=()).with_stage(dataclasses.replace(highest, provenance=source))
    write_checkpoint(run_file, alone)
    assert airrace("resume", run_file, "--dry-run").out.strip() == "point-mass: keep"
    for command in (("verify",), ("show",), ("export", "csv")):
        assert airrace(*command, run_file).code == 0
    ran = airrace("resume", run_file, "--from", "point-mass", "--dry-run")
    assert ran.out.split("\n")[0] == "homotopy: run (not finished)"


def test_start_that_is_interrupted_before_its_first_stage_is_to_be_asked_again(
    run_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(procedure, "optimize", interrupted)
    ran = airrace("resume", run_file, *CHANGE, "--output", "NEW.h5")
    assert ran.code == 130
    assert "start from RUN.h5 again with --force" in ran.err
