"""A table of any length is written piece by piece, and is the same wherever it goes."""

import io
from pathlib import Path

import pytest
from example_flights import half_cuban
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.export import flight_table
from airrace.export.csv import export_flight_csv


def test_the_table_of_a_flight_is_the_same_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    def written() -> str:
        stream = io.StringIO(newline="")
        export_flight_csv(half_cuban().flight(), stream, rate_hz=50.0)
        return stream.getvalue()

    whole = written()
    assert whole.count("\n") > 400
    monkeypatch.setattr(flight_table, "ROWS_AT_ONCE", 7)
    assert written() == whole


def test_the_table_in_a_file_is_the_one_on_stdout_and_that_of_python(tmp_path: Path) -> None:
    stored, path = half_cuban().save(tmp_path / "run.h5"), tmp_path / "run.csv"
    stage = half_cuban()["point-mass"]
    text = stage.to_csv(rate=30.0)
    assert text.count("\n") > 200
    assert stage.to_csv(path, rate=30.0) == ""
    assert path.read_bytes().decode() == text
    ran = CliRunner().invoke(app, ["export", "csv", str(stored), "--rate", "30"])
    assert (ran.exit_code, ran.stdout) == (0, text)
