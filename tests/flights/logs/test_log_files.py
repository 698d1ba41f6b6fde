"""A flight log is stored, validated when it is read, and taken by every command that takes flights."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic import BEGIN, csv_text, fixes, gpx_text, known
from typer.testing import CliRunner

import airrace
from airrace.cli.main import app
from airrace.errors import CheckpointError, UsageError
from airrace.files.checkpoint import LogCheckpoint, StoredHistory, read_checkpoint, read_stored, write_log
from airrace.files.checkpoint.store import seal, unseal
from airrace.runs.flight_sources import open_flight, open_flights
from airrace.runs.log_view import LogView, open_log


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Holds `log.csv` and, imported, `log.h5`."""
    place = tmp_path_factory.mktemp("flown")
    (place / "log.csv").write_text(csv_text(fixes(20.0)))
    airrace.import_log(place / "log.csv", "rovinj_2014").save(place / "log.h5")
    return place


@pytest.fixture(scope="module")
def recorded(folder: Path) -> LogCheckpoint:
    found = read_stored(folder / "log.h5")
    assert isinstance(found, LogCheckpoint)
    return found


def run(*arguments: str | Path) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, [str(one) for one in arguments])
    return result.exit_code, result.stdout, result.stderr


def test_a_stored_flight_is_the_imported_one(folder: Path, recorded: LogCheckpoint) -> None:
    imported, opened = airrace.import_log(folder / "log.csv", "rovinj_2014"), open_log(recorded)
    first, second = imported.flight(), open_flight(str(folder / "log.h5"))
    assert (first.label, second.label) == ("log", "log.h5")
    assert list(first.histories) == list(second.histories)
    for name in first.histories:
        assert np.array_equal(first[name], second[name])
        assert (first.basis(name), first.limit(name)) == (second.basis(name), second.limit(name))
    crossings = [[(one.name, one.time, one.values) for one in flight.crossings] for flight in (first, second)]
    assert crossings[0] == crossings[1]
    assert opened.violations
    assert opened.penalty == 0.0
    assert repr(opened.violations) == repr(imported.violations)
    log, seen = recorded.log, fixes(20.0)
    assert (log.format, Path(log.path).name) == ("csv", "log.csv")
    rows = np.isin(np.round(seen.time - seen.time[0], 4), np.round(log.time, 4))
    assert log.columns["x"] == pytest.approx(seen.north[rows], abs=1e-3)
    assert log.lines[0] >= 2


def test_the_clock_of_a_flight_is_that_of_its_log(folder: Path, tmp_path: Path) -> None:
    dated = tmp_path / "dated.gpx"
    dated.write_text(gpx_text(fixes(20.0)))
    log = airrace.import_log(dated, "rovinj_2014")
    assert log.begins is not None
    start = BEGIN + timedelta(seconds=known().passings["0:g0"])
    assert abs((log.begins - start).total_seconds()) < 0.05
    log.save(tmp_path / "dated.h5")
    assert open_flight(str(tmp_path / "dated.h5")).source.begins == log.begins
    assert open_flight(str(folder / "log.h5")).source.begins is None
    path = tmp_path / "dated.acmi"
    assert run("export", "acmi", tmp_path / "dated.h5", "--output", path)[0] == 0
    assert f"ReferenceTime={log.begins:%Y-%m-%dT%H:%M:%S}Z" in path.read_text("utf-8-sig")


def test_other_courses_are_refused_before_anything_is_measured(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    track = tmp_path / "short.yaml"
    whole = (Path(__file__).parents[3] / "tracks" / "rovinj_2014.yaml").read_text()
    lines = whole.rstrip().splitlines()
    assert lines[-2] == "    - g1"
    track.write_text("\n".join([*lines[:-2], lines[-1]]) + "\n")
    airrace.import_log(folder / "log.csv", track).save(tmp_path / "short.h5")

    def fail(*_: object, **__: object) -> None:
        raise AssertionError("it was measured")

    monkeypatch.setattr("airrace.runs.verification.with_verification", fail)
    monkeypatch.setattr("airrace.runs.flight_sources.fly_log_through", fail)
    for others in ((), (folder / "log.csv",)):
        code, _, err = run("compare", folder / "log.h5", tmp_path / "short.h5", *others)
        assert code == 2
        assert f"{tmp_path / 'short.h5'} and {folder / 'log.h5'} cannot be compared" in err


def test_an_offset_raises_all_heights(folder: Path) -> None:
    plain, raised = (airrace.import_log(folder / "log.csv", "rovinj_2014", height_offset=up) for up in (0.0, 12.0))
    heights = [view.recorded.log.columns["height"] for view in (plain, raised)]
    assert heights[1] == pytest.approx(heights[0] + 12.0)
    assert any("+12 m are added to all heights" in remark for remark in raised.remarks)
    with pytest.raises(UsageError, match="a height offset of 1e"):
        airrace.import_log(folder / "log.csv", "rovinj_2014", height_offset=1e6)


def test_the_command_imports_and_says_what_it_found(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "flown.h5"
    code, out, _ = run("import", folder / "log.csv", "--course", "rovinj_2014", "--output", output)
    assert code == 0
    assert "log: race time 55.5" in out
    assert "rules that would be broken" in out
    assert "note: positions come at 20 Hz" in out
    assert max(len(line) for line in out.splitlines() if str(output) not in line) <= 80
    again = run("import", folder / "log.csv", "--course", "rovinj_2014", "--output", output)
    assert again[0] == 2
    assert "exists" in again[2]


def test_the_object_tells_passings_breaches_and_bases(folder: Path) -> None:
    code, out, _ = run("show", folder / "log.h5", "--json")
    told = json.loads(out)
    assert code == 0
    assert told["race_time_s"] == pytest.approx(list(known().passings.values())[-1], abs=0.05)
    assert [one["passing"] for one in told["passings"]] == list(known().passings)
    assert {"rule", "certain", "penalty_s", "deviation"} <= set(told["violations"][0])
    assert told["histories"]["mu"] == "derived"
    assert len(told["legs"]) == len(known().passings) - 1


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("show", "log.h5", "--legs"), 0, "legs: speeds and clearances"),
        (("compare", "log.h5", "log.csv"), 0, "a tie within 5 ms"),
        (("export", "csv", "log.h5", "--rate", "10"), 0, "time_s,"),
        (("export", "csv", "log.h5", "--splits"), 0, "1:g4,"),
        (("resume", "log.h5"), 7, "this is a flight log, not a run"),
        (("sensitivity", "log.h5"), 7, "this is a flight log, not a run"),
        (("show", "log.h5", "--stage", "six-dof"), 2, "a flight log has no stages"),
        (("compare", "log.csv", "log.csv"), 2, "no course is at hand for the log"),
        (("compare", "log.csv", "log.csv"), 2, "--course TRACK"),
    ],
)
def test_commands_of_flights_take_flown_logs_and_those_of_runs_refuse_them(
    folder: Path, arguments: tuple[str, ...], code: int, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    exit_code, out, err = run(*arguments)
    assert (exit_code, err == "") == (code, code == 0)
    assert words in (err or out)


def test_an_exported_flight_is_imported_again(folder: Path, tmp_path: Path) -> None:
    """The table tells more than positions, and its clock is that of the flight."""
    table, again = tmp_path / "again.csv", tmp_path / "again.h5"
    assert run("export", "csv", folder / "log.h5", "--rate", "50", "--output", table)[0] == 0
    assert run("import", table, "--course", "rovinj_2014", "--output", again, "--quiet")[0] == 0
    first, second = open_flights([str(folder / "log.h5"), str(again)])
    assert [one.time for one in second.crossings] == pytest.approx([one.time for one in first.crossings], abs=0.01)


@pytest.mark.parametrize("name", ["kml", "acmi", "gpx", "fdr", "czml", "geojson", "mat"])
def test_formats_of_other_programs_take_flown_logs(folder: Path, tmp_path: Path, name: str) -> None:
    assert run("export", name, folder / "log.h5", "--output", tmp_path / f"flight.{name}", "-q") == (0, "", "")


def test_the_report_shows_a_flown_log(folder: Path, tmp_path: Path) -> None:
    hostile = folder / "<script>alert(1)<script>.csv"
    hostile.write_text((folder / "log.csv").read_text())
    run("import", hostile, "--course", "rovinj_2014", "--output", folder / "hostile.h5")
    page = tmp_path / "report.html"
    assert run("report", folder / "hostile.h5", folder / "log.h5", "--output", page)[0] == 0
    text = page.read_text()
    assert "recorded" in text
    assert "Penalties of what is certain: 0 s." in text
    assert f"<footer>airrace {version('airrace')}</footer>" in text
    assert "<script>alert(1)" not in text
    assert run("report", folder / "log.h5", "--sensitivities", "--output", tmp_path / "other.html")[0] == 5


def test_a_refused_log_gives_one_sentence_and_its_code(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("time,x,y,height\n0,1,2,3\n1,one,2,3\n")
    code, out, err = run("import", tmp_path / "log.csv", "--course", "rovinj_2014")
    assert (code, out) == (3, "")
    assert err.splitlines() == [
        f"{tmp_path / 'log.csv'}:3:1: x: `one` is no number",
        "airrace: the input is not valid: 1 finding",
    ]
    assert not (tmp_path / "log.h5").exists()


def tampered(content: bytes, path: Path, edit: Callable[[h5py.File], object]) -> bytes:
    """A file, edited and with its checksum computed anew."""
    path.write_bytes(unseal(content))
    with h5py.File(path, "r+") as file:
        edit(file)
    return seal(path.read_bytes())


def test_tampered_files_are_refused(recorded: LogCheckpoint, tmp_path: Path) -> None:
    time = recorded.time
    one = recorded.histories[0]
    tampered_logs = {
        "does not run forwards": replace(recorded, time=time[::-1].copy()),
        "do not follow one another": replace(recorded, passings=tuple(reversed(recorded.passings))),
        "holds numbers that are not finite": replace(
            recorded, histories=(replace(one, values=np.full_like(time, math.nan)), *recorded.histories[1:])
        ),
        "is neither measured nor derived": replace(
            recorded, histories=(replace(one, basis="<b>"), *recorded.histories[1:])
        ),
        "is missing": replace(recorded, histories=recorded.histories[1:]),
    }
    for said, tampered_log in tampered_logs.items():
        with pytest.raises(CheckpointError, match=said):
            write_log(tmp_path / "tampered.h5", tampered_log)
    assert list(tmp_path.iterdir()) == []


def test_damaged_files_and_other_schemas_members_names_and_courses_are_refused(
    folder: Path, recorded: LogCheckpoint, tmp_path: Path
) -> None:
    renamed = tuple(replace(one, passing=f"x{one.passing}") for one in recorded.passings)
    with pytest.raises(CheckpointError, match="its passings are not those of its course"):
        LogView(open_log(recorded).inputs, replace(recorded, passings=renamed)).flight()
    for edit, said in (
        (lambda file: file.attrs.modify("schema", np.int64(9)), "schema 9"),
        (lambda file: file.attrs.modify("content", np.bytes_("flight pan")), "holds a flight pan"),
        (lambda file: file.create_group("extra"), "/: 'extra' is unknown"),
        (lambda file: file.create_group("flight/extra"), "/flight: 'extra' is unknown"),
        (lambda file: file.move("flight/time", "time"), "'time' is unknown"),
        (lambda file: (file.pop("flight/label"), file.create_group("flight/label")), "label is not a text"),
    ):
        (tmp_path / "tampered.h5").write_bytes(tampered((folder / "log.h5").read_bytes(), tmp_path / "image.h5", edit))
        with pytest.raises(CheckpointError, match=said):
            read_stored(tmp_path / "tampered.h5")
    one = recorded.histories[0]
    bad = StoredHistory(replace(one.quantity, name="../x"), one.values, one.basis)
    with pytest.raises(CheckpointError, match="is not a name"):
        write_log(tmp_path / "bad.h5", replace(recorded, histories=(bad, *recorded.histories)))
    content = bytearray((folder / "log.h5").read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / "damaged.h5").write_bytes(content)
    with pytest.raises(CheckpointError, match="its checksum does not match"):
        read_stored(tmp_path / "damaged.h5")
    with pytest.raises(CheckpointError, match="this is a flight log"):
        read_checkpoint(folder / "log.h5")


@pytest.mark.slow
def test_five_million_rows_are_read(tmp_path: Path) -> None:
    """A day at 60 Hz, of which a minute is the race."""
    seen = fixes(20.0)
    race = csv_text(seen, offset=100_000.0).splitlines(keepends=True)
    path = tmp_path / "long.csv"
    with path.open("w") as file:
        file.write(race[0])
        for row in range(5_000_000):
            file.write(f"{row / 60.0:.4f},-900.0,-900.0,0.0\n")
        file.writelines(race[1:])
    flown = airrace.import_log(path, "rovinj_2014")
    assert flown.flight().race_time == pytest.approx(list(known().passings.values())[-1], abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["csv", "gpx", "acmi"])
def test_an_exported_optimum_is_imported_again_and_breaks_no_rule(tmp_path: Path, name: str) -> None:
    run_file, exported = tmp_path / "run.h5", tmp_path / f"optimum.{name}"
    optimum = airrace.optimize("rovinj_2014", until="point-mass")
    optimum.save(run_file)
    assert run("export", name, run_file, "--output", exported, "-q")[0] == 0
    again, flight = airrace.import_log(exported, "rovinj_2014"), optimum.stages[-1].flight()
    assert [one for one in again.violations if one.certain] == []
    assert [one.time for one in again.flight().crossings] == pytest.approx(
        [one.time for one in flight.crossings], abs=0.005
    )
