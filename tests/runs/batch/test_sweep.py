"""A sweep is what its single answers are: in order, whatever solves them, and written as it is shown."""

import csv
import math
import re
from functools import cache
from pathlib import Path

import command
import pytest
from pyarrow import parquet

import airrace
from airrace.api.run import Run
from airrace.errors import InputError, UsageError
from airrace.procedure.result import Status
from airrace.runs.batch.sweep import SweepPoint, SweepResult


@cache
def run() -> Run:
    """A point mass on the shortest course."""
    return airrace.optimize("half_cuban_eight", until="point-mass", search="off")


def test_points_are_answers_of_a_session_in_the_order_of_the_combinations(tmp_path: Path) -> None:
    file = tmp_path / "sweep.csv"
    sweep = {"rules.n_z_max": "9:10:0.5", "environment.temperature_offset_K": [0, 10]}
    found = airrace.sweep(run(), sweep, threads=2, output=file)
    assert [one.values for one in found.points] == [(n_z, t) for n_z in ("9", "9.5", "10") for t in ("0", "10")]
    assert found.solved == 6
    with airrace.Session(run()) as session:
        for one in found.points:
            alone = session.solve({key: float(value) for key, value in zip(found.keys, one.values, strict=True)})
            assert alone.race_time == pytest.approx(one.race_time, abs=1e-4)
        assert session.certify(alone).result().certified
    times = [one.race_time for one in found.points if one.values[1] == "0"]
    assert times == sorted(times, reverse=True)  # a tighter limit is never faster
    assert times[-1] == pytest.approx(found.reference, abs=1e-4)  # its own limit
    rows = list(csv.DictReader(file.read_text().splitlines()))
    assert [float(row["race_time_s"]) for row in rows] == [one.race_time for one in found.points]
    assert list(rows[0]) == [*sweep, "race_time_s", "change_s", "status", "message"]


@pytest.mark.parametrize(("change", "shown"), [(-1e-5, "+0.000"), (1e-5, "+0.000"), (-0.002, "-0.002")])
def test_a_change_that_rounds_to_nothing_has_no_minus(change: float, shown: str) -> None:
    point = SweepPoint(("9",), 55.0 + change, Status.SOLVED)
    table = SweepResult("point-mass", ("rules.n_z_max",), 55.0, (point,)).table()
    heads, row = table.texts()
    assert row[heads.index("change s")] == shown


def test_what_cannot_be_flown_is_a_point_and_its_neighbours_are_solved() -> None:
    found = airrace.sweep(run(), ["rules.n_z_max=1.2,9.9"])
    bad, good = found.points
    assert math.isnan(bad.race_time)
    assert bad.status is not Status.SOLVED
    assert bad.message
    assert good.status is Status.SOLVED


@pytest.mark.parametrize(
    ("sweep", "error", "text"),
    [
        ([], UsageError, "nothing is swept"),
        (["rules.n_z_max=0:1:0.000001"], InputError, "more than 100000"),
        (["rules.n_z_mx=9"], InputError, "n_z_max"),
        (["rules.n_z_max=9", "rules.n_z_max=10"], InputError, "twice"),
        (["settings.regularisation=1e-5,1"], UsageError, "settings.regularisation: .*`airrace batch --sweep`"),
        (["settings.mesh.interval_s=0.1", "rules.n_z_max=9"], UsageError, "settings.mesh.interval_s: "),
        (["rules.reserve.probability=0.5,0.99"], UsageError, "rules.reserve.probability: .*`airrace batch --sweep`"),
        (["aircraft=edge450"], InputError, "edge540"),
    ],
)
def test_wrong_sweeps_are_reported_before_a_solve(sweep: list[str], error: type[Exception], text: str) -> None:
    with pytest.raises(error) as raised:
        airrace.sweep(run(), sweep)
    findings = raised.value.findings if isinstance(raised.value, InputError) else [raised.value]
    assert re.search(text, " ".join(map(str, findings)))


def test_a_session_refuses_other_settings_and_takes_those_of_its_run() -> None:
    with airrace.Session(run()) as session:
        with pytest.raises(UsageError, match=r"settings\.certificate\.race_time_s: "):
            session.solve({"settings.certificate.race_time_s": 0.001})
        same = session.solve({"settings.search": "off", "settings.regularisation": 1e-3})
        assert same.race_time == pytest.approx(session.optimum.race_time, abs=1e-4)


def test_the_aircraft_may_be_swept() -> None:
    found = airrace.sweep(run(), {"aircraft": ["edge540", "mxs_r"]})
    assert found.solved == 2
    assert found.points[0].race_time == pytest.approx(found.reference, abs=1e-4)
    scratch = airrace.optimize("half_cuban_eight", until="point-mass", search="off", aircraft="mxs_r")
    assert found.points[1].race_time == pytest.approx(scratch.race_time, abs=2e-3)
    assert abs(scratch.race_time - found.reference) > 0.02


@pytest.mark.slow
@pytest.mark.parametrize(
    "values",
    [{"aircraft.roll.C_lp": -0.3, "aircraft.pitch.C_m0": 0.05}, {"environment.wind.speed_kt": 15}, {"aircraft": "pc9"}],
)
def test_a_session_finds_what_a_run_finds_that_is_started_from_it(values: dict[str, float | str]) -> None:
    wind = {"environment.wind.from_deg": 90, "environment.wind.speed_kt": 5, "environment.wind.profile": "power"}
    known = airrace.optimize("half_cuban_eight", set=wind)
    changed = airrace.resume(known, set={**values, "settings.search": "off", "settings.alternatives": 1})
    assert changed.certified
    with airrace.Session(known) as session:
        assert session.solve(values).race_time == pytest.approx(changed.race_time, abs=5e-3)


def test_a_key_that_affects_no_flight_is_named() -> None:
    found = airrace.sweep(run(), {"notes": ["a", "b"], "rules.n_z_max": [9, 10]})
    assert found.without_effect == ("notes",)
    assert found.as_object()["without_effect"] == ["notes"]
    assert found.table().notes == ["notes affects no flight: all of its values ask for the same one"]


def test_the_command_prints_a_table_or_an_object_and_writes_parquet(tmp_path: Path) -> None:
    file, table = run().save(tmp_path / "run.h5"), tmp_path / "sweep.parquet"
    call = ["sweep", str(file), "--sweep", "rules.n_z_max=9,10", "--output", str(table)]
    printed = command.run(*call)
    assert printed.code == 0, printed.err
    assert re.search(r"\b9 +8\.\d{3} +\+0\.\d{3} +solved", printed.out)
    assert parquet.read_table(table).column_names[:2] == ["rules.n_z_max", "race_time_s"]
    assert command.run(*call).code == 2  # the file exists
    unaffected = command.run("sweep", str(file), "--sweep", "notes=a,b").out
    assert "notes affects no flight" in " ".join(unaffected.split())
    told = command.run(*call, "--force", "--json").answer
    assert told["solved"] == 2
    assert told["points"][0]["rules.n_z_max"] == 9
