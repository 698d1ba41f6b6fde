"""`airrace report`: a page in the file that was named, and a sentence for everything that prevents it."""

from pathlib import Path

import pytest
from example_flights import half_cuban, windy
from report_pages import read
from typer.testing import CliRunner, Result

import airrace
from airrace.cli.main import app
from airrace.errors import UsageError
from airrace.runs.command_result import ExitCode


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs of one course."""
    place = tmp_path_factory.mktemp("runs")
    half_cuban().save(place / "still.h5")
    windy().save(place / "windy.h5")
    return place


def called(*words: object) -> Result:
    return CliRunner().invoke(app, ["report", *map(str, words)])


def test_a_run_becomes_a_page(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    ran = called(folder / "still.h5", "--output", page)
    assert (ran.exit_code, ran.output) == (ExitCode.DONE, f"{page} is written; any browser opens it\n")
    parsed = read(page.read_text(encoding="utf-8"))
    assert parsed.texts["h1"] == ["Half Cuban Eight"]
    assert parsed.contents["flights"][0]["race_time"] == pytest.approx(half_cuban().race_time)


def test_stages_and_runs_fly_beside_it(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    others = (f"{folder / 'still.h5'}:homotopy", folder / "windy.h5")
    assert called(folder / "still.h5", *others, "--output", page).exit_code == ExitCode.DONE
    flights = read(page.read_text(encoding="utf-8")).contents["flights"]
    stages = [half_cuban(), half_cuban().stage("homotopy"), windy()]
    assert [one["race_time"] for one in flights] == pytest.approx([stage.race_time for stage in stages])
    assert len({one["label"] for one in flights}) == 3


def test_another_stage_is_named(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert called(folder / "still.h5", "--stage", "homotopy", "--output", page).exit_code == ExitCode.DONE
    parsed = read(page.read_text(encoding="utf-8"))
    assert parsed.contents["flights"][0]["race_time"] == pytest.approx(half_cuban().stage("homotopy").race_time)


def test_prices_are_told_on_request(folder: Path, tmp_path: Path) -> None:
    plain, priced = tmp_path / "plain.html", tmp_path / "priced.html"
    assert called(folder / "still.h5", "--output", plain).exit_code == ExitCode.DONE
    assert called(folder / "still.h5", "--output", priced, "--sensitivities").exit_code == ExitCode.DONE
    key = next(iter(half_cuban().sensitivities()))
    assert key in read(priced.read_text(encoding="utf-8")).texts["td"]
    assert key not in read(plain.read_text(encoding="utf-8")).texts["td"]


def test_a_file_that_exists_is_kept_unless_forced(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("mine", encoding="utf-8")
    ran = called(folder / "still.h5", "--output", page)
    assert ran.exit_code == ExitCode.USAGE
    assert page.read_text(encoding="utf-8") == "mine"
    assert called(folder / "still.h5", "--output", page, "--force").exit_code == ExitCode.DONE
    assert page.read_text(encoding="utf-8") != "mine"


def test_flights_of_another_course_are_refused_with_a_sentence(folder: Path, tmp_path: Path) -> None:
    other = airrace.optimize("half_cuban_eight", until="homotopy", set={"gates.exit.climb_deg": 1}, search="off")
    other.save(tmp_path / "same.h5")
    text = half_cuban().inputs.track.text.replace("upright", "level_again")
    (tmp_path / "other.yaml").write_text(text, encoding="utf-8")
    airrace.optimize(tmp_path / "other.yaml", until="homotopy", search="off").save(tmp_path / "other.h5")
    assert called(folder / "still.h5", tmp_path / "same.h5", "--output", tmp_path / "a.html").exit_code == ExitCode.DONE
    ran = called(folder / "still.h5", tmp_path / "other.h5", "--output", tmp_path / "b.html")
    assert ran.exit_code == ExitCode.USAGE
    assert "other:homotopy and still:point-mass cannot be compared" in " ".join(ran.output.split())
    assert not (tmp_path / "b.html").exists()


@pytest.mark.parametrize(
    ("flight", "code"), [("none.h5", ExitCode.BAD_CHECKPOINT), ("still.h5:five-dof", ExitCode.USAGE)]
)
def test_flights_that_do_not_exist_are_refused(folder: Path, tmp_path: Path, flight: str, code: ExitCode) -> None:
    ran = called(folder / "still.h5", folder / flight, "--output", tmp_path / "page.html")
    assert ran.exit_code == code
    assert not (tmp_path / "page.html").exists()


def test_prices_of_a_guess_are_refused(folder: Path, tmp_path: Path) -> None:
    ran = called(folder / "still.h5", "--stage", "homotopy", "--sensitivities", "--output", tmp_path / "page.html")
    assert ran.exit_code == ExitCode.NOT_CERTIFIED


def test_in_python_a_run_writes_its_report(folder: Path, tmp_path: Path) -> None:
    written = half_cuban().report(tmp_path / "page.html", str(folder / "windy.h5"))
    flights = read(written.read_text(encoding="utf-8")).contents["flights"]
    assert [one["race_time"] for one in flights] == pytest.approx([half_cuban().race_time, windy().race_time])
    with pytest.raises(UsageError, match="no stage 'five-dof'"):
        half_cuban().report(tmp_path / "page.html", stage="five-dof")
