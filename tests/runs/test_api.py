"""The commands as functions: what they take, what they return, and what they leave alone."""

import dataclasses
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import fake_optimizer
import pytest

import airrace
from airrace.api.run import Run
from airrace.errors import CheckpointError, InputError, UsageError
from airrace.procedure.result import OUTCOMES, Silent, StageResult, Status
from airrace.procedure.stage import Stage

ROOT = Path(__file__).parents[2]
ROVINJ = ROOT / "tracks" / "rovinj_2014.yaml"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, and a procedure that computes nothing."""
    monkeypatch.chdir(tmp_path)
    for name, module in fake_optimizer.REPLACED.items():
        monkeypatch.setattr(f"{module}.{name}", getattr(fake_optimizer, name))
    return tmp_path


@pytest.fixture
def run() -> Run:
    return airrace.optimize("rovinj_2014")


def test_nothing_is_printed_and_nothing_is_written_unasked(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    airrace.optimize("rovinj_2014")
    printed = capfd.readouterr()
    assert (printed.out, printed.err) == ("", "")
    assert list(folder.iterdir()) == []


def test_warnings_of_the_library_are_for_those_who_listen() -> None:
    program = (
        "import logging, airrace; airrace.tracks; "
        "logging.getLogger('airrace.somewhere').warning('the solver took another way')"
    )
    ran = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert (ran.stdout, ran.stderr) == ("", "")


def test_progress_is_shown_when_asked_for(capfd: pytest.CaptureFixture[str]) -> None:
    airrace.optimize("rovinj_2014", progress=True)
    printed = capfd.readouterr()
    assert printed.out == ""
    assert "point-mass: solved, certified" in printed.err


def test_a_stage_is_in_the_file_before_it_is_announced(folder: Path) -> None:
    file, kept = folder / "run.h5", dict[Stage, bool]()

    class Reader(Silent):
        def stage_finished(self, result: StageResult) -> None:
            kept[result.stage] = result.stage in airrace.open(file)

    airrace.optimize("rovinj_2014", output=file, progress=Reader())
    assert kept == {Stage.HOMOTOPY: True, Stage.POINT_MASS: True}


def test_a_run_knows_its_numbers(run: Run) -> None:
    assert run.name == "rovinj_2014"
    assert run.race_time == run["point-mass"].race_time == run[Stage.POINT_MASS].race_time == pytest.approx(10.0)
    assert run.certified
    assert run.message == ""
    assert [stage.name for stage in run] == ["homotopy", "point-mass"]
    assert "point-mass" in run
    assert Stage.SIX_DOF not in run
    assert [split.name for split in run.splits] == [passage.name for passage in run.race.course.passages]
    assert run.splits[1:][0] == run.splits[1]
    assert repr(run) == "<Run rovinj_2014: point-mass, 10.000 s, certified>"


def test_a_stage_that_is_not_there_is_named_with_those_that_are(run: Run) -> None:
    with pytest.raises(UsageError, match="no stage 'six-dof'; it has: homotopy, point-mass"):
        run["six-dof"]


@pytest.mark.parametrize("outcome", [one for one in OUTCOMES if one is not Status.SOLVED])
def test_a_run_that_fails_is_a_run_that_says_why(outcome: Status, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FAKE_SCENARIO", outcome.value)
    run = airrace.optimize("rovinj_2014")
    assert not run.certified
    assert run.message == "point-mass: gate g1 cannot be reached"
    assert math.isnan(run.race_time) == (outcome is not Status.NOT_CERTIFIED)
    assert (len(run.splits) == 0) == math.isnan(run.race_time)
    assert "not certified" in repr(run)
    if outcome is not Status.NOT_CERTIFIED:  # its canned flight has too few histories to be drawn
        assert "gate g1 cannot be reached" in run._repr_html_()


@pytest.mark.parametrize("named", ["rovinj_2014", str(ROVINJ), ROVINJ])
@pytest.mark.parametrize("aircraft", [None, "pc9", ROOT / "configs" / "pc9.yaml"])
def test_names_paths_and_texts_mean_the_same(named: str | Path, aircraft: str | Path | None) -> None:
    run = airrace.optimize(named, aircraft=aircraft)
    expected = airrace.load_inputs(ROVINJ, aircraft=aircraft or "edge540")
    assert run.race == expected.race


def test_values_are_set_by_keys_or_as_texts() -> None:
    by_key = airrace.optimize("rovinj_2014", set={"rules.n_z_max": 9, "rules.preset": "rbar-2016"}, search="off")
    texts = ["rules.n_z_max=9", "rules.preset=rbar-2016", "settings.search=off"]
    assert by_key.inputs.overrides == tuple(texts)
    assert airrace.optimize("rovinj_2014", set=texts).inputs.resolved == by_key.inputs.resolved


def test_objects_are_flown_as_they_are(run: Run) -> None:
    race = run.race
    light = dataclasses.replace(race.aircraft, airframe=dataclasses.replace(race.aircraft.airframe, m=600.0))
    by_course = airrace.optimize(race.course, aircraft=light)
    by_race = airrace.optimize(dataclasses.replace(race, aircraft=light))
    assert by_course.race.aircraft == by_race.race.aircraft == light
    assert by_course.race.course == by_race.race.course == race.course
    assert by_course.name == "rovinj_2014"


def test_a_course_alone_has_no_aircraft(run: Run) -> None:
    with pytest.raises(InputError, match="names no aircraft"):
        airrace.optimize(run.race.course)


def test_what_is_saved_is_what_is_opened(run: Run, folder: Path) -> None:
    path = run.save("rovinj.h5")
    assert path == Path("rovinj.h5")
    again = airrace.open(path)
    assert repr(again) == repr(run)
    assert again.path == path
    assert run.path is None
    assert [stage.result.trajectory.state.tolist() for stage in again] == [
        stage.result.trajectory.state.tolist() for stage in run
    ]


def test_a_run_with_objects_is_saved_and_opened_alike(run: Run) -> None:
    built = airrace.optimize(run.race.course, aircraft=run.race.aircraft)
    assert airrace.open(built.save("built.h5")).race == built.race


def test_a_file_is_kept_from_the_first_stage_on_and_never_overwritten_unasked() -> None:
    run = airrace.optimize("rovinj_2014", until="homotopy", output="kept.h5")
    assert [stage.name for stage in airrace.open("kept.h5")] == ["homotopy"]
    with pytest.raises(UsageError, match="exists"):
        airrace.optimize("rovinj_2014", output="kept.h5")
    further = run.resume()
    assert [stage.name for stage in further] == ["homotopy", "point-mass"]
    assert [stage.name for stage in airrace.open("kept.h5")] == ["homotopy", "point-mass"]
    assert [stage.name for stage in run] == ["homotopy"]


def test_a_run_in_memory_is_resumed_in_memory(run: Run, folder: Path) -> None:
    begun = airrace.optimize("rovinj_2014", until=Stage.HOMOTOPY)
    assert [stage.name for stage in begun.resume(until="point-mass")] == ["homotopy", "point-mass"]
    assert list(folder.iterdir()) == []
    assert airrace.resume(begun, output="now.h5").path == Path("now.h5")
    assert "point-mass" in airrace.open("now.h5")


def test_a_changed_run_is_another_one(run: Run) -> None:
    windy = run.resume(set={"environment.wind.from_deg": 0, "environment.wind.speed_kt": 5})
    assert windy.race.air.wind is not None
    assert run.race.air.wind is None
    assert [leg.difference for leg in run.compare(windy).legs] == [0.0] * 16
    failed = run.of(run.with_stage(replace(run.results[-1], outcome=Status.NOT_CERTIFIED)))
    with pytest.raises(UsageError, match="no stage is certified or solved both in"):
        run.compare(failed)
    with pytest.raises(UsageError, match="goes on in the same run"):
        run.resume(set={"rules.n_z_max": 9}, from_="point-mass")


def test_a_changed_run_does_not_overwrite_the_one_it_starts_from(run: Run) -> None:
    run.save("first.h5")
    with pytest.raises(UsageError, match="is read by this command"):
        airrace.resume("first.h5", set={"rules.n_z_max": 9}, output="first.h5", force=True)


def test_certificates_are_measured_again(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    guess, optimum = run.verify()
    assert (guess.verified, optimum.verified) == (True, True)
    assert guess.finding == "verified as a guess, of which nothing but its gate splits can be verified"
    monkeypatch.setenv("FAKE_SCENARIO", "loose")
    _, optimum = run.verify()
    assert optimum.objection.startswith("it does not hold: kkt_error")


def test_a_course_is_checked_without_being_flown() -> None:
    checked = airrace.check("rovinj_2014", set=["gate_defaults.width_m=9"])
    assert repr(checked) == "<CourseCheck Rovinj 2014: 17 passages, 5 warnings>"
    assert checked.as_object()["name"] == "Rovinj 2014"
    assert "<svg" in checked._repr_html_()


def test_findings_are_all_told_at_once() -> None:
    with pytest.raises(InputError) as raised:
        airrace.optimize("rovinj_2014", aircraft="edge541", set={"rules.n_z_mx": 9})
    assert len(raised.value.findings) == 2


def test_what_is_no_run_is_refused_with_a_sentence(folder: Path) -> None:
    (folder / "no.h5").write_bytes(b"no")
    with pytest.raises(CheckpointError):
        airrace.open("no.h5")
    with pytest.raises(CheckpointError, match="there is no checkpoint"):
        airrace.open("nowhere.h5")


@pytest.mark.parametrize(("method", "package"), [("to_dataframe", "pandas"), ("to_xarray", "xarray")])
def test_a_missing_package_is_said_in_one_sentence(
    run: Run, method: str, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UsageError, match=rf"needs {package}: pip install 'airrace\[{package}\]'"):
        getattr(run["point-mass"], method)()


def test_a_data_frame_says_what_it_is_as_a_dataset_does(run: Run) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    view = run["point-mass"]
    attributes = view.to_dataframe().attrs
    assert attributes == view.to_xarray().attrs
    assert attributes["stage"] == "point-mass"
    assert attributes["certified"] == view.certified


def test_all_names_of_the_package_lead_somewhere() -> None:
    assert sorted(airrace.__all__) == airrace.__all__ == dir(airrace)
    for name in airrace.__all__:
        assert getattr(airrace, name) is not None
    with pytest.raises(AttributeError, match="optimise"):
        airrace.optimise  # noqa: B018  (looked up for its error)


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = ("casadi", "h5py", "numpy", "pydantic", "rich", "scipy", "typer", "yaml")
    program = f"import sys, airrace; print([name for name in {heavy} if name in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"


def test_the_package_is_the_command(folder: Path) -> None:
    ran = subprocess.run([sys.executable, "-m", "airrace", "--version"], capture_output=True, text=True, check=True)
    assert ran.stdout.startswith("airrace ")
    assert (ROOT / "airrace" / "py.typed").exists()
