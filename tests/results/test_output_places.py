"""A command that makes a file of a file writes it beside that file, and never over another one unasked."""

import os
from pathlib import Path

import pytest
from example_flights import half_cuban
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.runs.output import default_output_path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run, which is not the current one."""
    place = tmp_path_factory.mktemp("runs")
    half_cuban().save(place / "eight.h5")
    return place


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("report",), "eight.html"),
        (("plot",), "eight.png"),
        (("plot", "--kneeboard"), "eight.kneeboard.png"),
        (("export", "mat"), "eight.mat"),
        (("export", "netcdf"), "eight.nc"),
    ],
)
def test_results_lie_beside_the_run_and_are_not_overwritten(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    before = set(folder.iterdir())
    flight = f"{folder / 'eight.h5'}:point-mass"
    assert CliRunner().invoke(app, [*words, flight]).exit_code == 0
    assert {path.name for path in set(folder.iterdir()) - before} == {name}
    assert os.listdir(tmp_path) == []
    refused = CliRunner().invoke(app, [*words, flight])
    assert (refused.exit_code, refused.stderr.count("--force")) == (2, 1)


@pytest.mark.parametrize("words", [("report",), ("export", "kml", "--origin", "45,13"), ("export", "csv")])
def test_no_command_overwrites_the_run_that_it_reads(folder: Path, words: tuple[str, ...]) -> None:
    run = folder / "eight.h5"
    before = run.read_bytes()
    for name in (f"{run}", f"{run}:point-mass"):
        output = folder / ".." / folder.name / run.name
        refused = CliRunner().invoke(app, [*words, name, "--output", str(output), "--force"])
        assert refused.exit_code == 2
        assert "is read by this command; write into another file" in refused.stderr
        assert run.read_bytes() == before


def test_no_import_overwrites_its_log(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("time,latitude,longitude,altitude\n")
    refused = CliRunner().invoke(app, ["import", str(log), "--course", "rovinj_2014", "--output", str(log), "--force"])
    assert (refused.exit_code, refused.stderr.count("is read by this command")) == (2, 1)


def test_the_name_is_that_of_the_file_without_its_stage() -> None:
    assert default_output_path("runs/rovinj.h5:six-dof", "html") == Path("runs/rovinj.html")
    assert default_output_path(Path("logs/2014.04.12.igc"), "h5") == Path("logs/2014.04.12.h5")
    assert default_output_path("run", "kneeboard.png") == Path("run.kneeboard.png")
