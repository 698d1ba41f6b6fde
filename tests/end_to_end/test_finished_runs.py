"""A whole run through the real command: optimise, look, verify, export."""

import csv
import dataclasses
import io
import shutil
from pathlib import Path

import pytest
from airrace_command import ALONG_THE_PLAN, HALF_CUBAN, POINT_MASS, ROOT, Ran, airrace, inside

from airrace.files.checkpoint import read_checkpoint, write_checkpoint
from airrace.files.checkpoint.store import seal, unseal
from airrace.procedure.result import Status

CERTIFICATE = {
    "clearance",
    "solver",
    "kkt_error",
    "negative_curvature",
    "replay_defect",
    "replay_gate",
    "path_load_factor",
    "path_length",
    "path_angle",
    "path_angular_rate",
    "path_speed",
    "gate_acceleration",
    "gate_angle",
    "gate_angular_rate",
    "gate_attitude",
    "gate_length",
    "gate_speed",
    "hamiltonian_drift",
    "race_time_change",
    "variation_n_z",
    "variation_n_y",
    "variation_p_Kbar",
}
KNOT = 1852.0 / 3600.0

WITHOUT = {"AIRRACE_NATIVE": "off"}


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("finished")


@pytest.fixture(scope="module")
def optimised(run_folder: Path) -> Ran:
    """`airrace optimize` of the half Cuban eight from the plan, in still air."""
    return airrace("optimize", HALF_CUBAN, *ALONG_THE_PLAN, "--json", cwd=run_folder)


@pytest.fixture
def run_file(optimised: Ran, run_folder: Path, tmp_path: Path) -> Path:
    """A copy of its checkpoint."""
    assert optimised.code == 0
    return Path(shutil.copy(run_folder / "half_cuban_eight.h5", tmp_path / "run.h5"))


def test_run_is_certified_and_says_so_in_one_object(optimised: Ran) -> None:
    assert optimised.code == 0
    answer = optimised.answer
    assert list(answer) == ["track", "certified", "race_time_s", "wall_s", "stages"]
    assert answer["certified"] is True
    assert optimised.stages == ["point-mass"]
    assert 8.0 < optimised.race_time < 9.5
    (stage,) = answer["stages"]
    assert stage["certified"]
    assert {item["name"] for item in stage["certificate"]["items"]} == CERTIFICATE
    assert all(item["holds"] for item in stage["certificate"]["items"])
    assert "point-mass: started" in optimised.err
    assert "point-mass: solved, certified" in optimised.err
    assert "\x1b" not in optimised.err


def test_default_run_solves_all_fidelities(tmp_path: Path) -> None:
    ran = airrace("optimize", HALF_CUBAN, "--json", "--quiet", cwd=tmp_path)
    assert ran.code == 0
    assert ran.err == ""
    fidelities = ["point-mass", "transfer-function", "state-space-inversion", "state-space", "six-dof"]
    assert ran.stages == ["homotopy", *fidelities]
    assert (tmp_path / "half_cuban_eight.h5").exists()


def test_run_without_the_native_library_is_certified(optimised: Ran, tmp_path: Path) -> None:
    ran = airrace("optimize", HALF_CUBAN, *ALONG_THE_PLAN, "--json", cwd=tmp_path, environment=WITHOUT)
    assert ran.code == 0
    assert ran.answer["certified"] is True
    assert ran.race_time == pytest.approx(optimised.race_time, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("guess", ["plan", "homotopy"])
@pytest.mark.parametrize("track", ["rovinj_2014", "sixteen_phases"])
def test_long_run_is_certified_also_without_the_native_library(track: str, guess: str, tmp_path: Path) -> None:
    path = ROOT / "tracks" / f"{track}.yaml"
    command = ("optimize", path, *POINT_MASS, "--guess", guess, "--json", "--quiet")
    ran = airrace(*command, cwd=tmp_path, environment=WITHOUT)
    assert (ran.code, ran.answer["certified"]) == (0, True)
    if guess == "plan":
        ran = airrace(*command, "--force", cwd=tmp_path)
        assert (ran.code, ran.answer["certified"]) == (0, True)
        again = airrace("verify", tmp_path / f"{track}.h5", "--json", cwd=tmp_path)
        assert (again.code, again.answer["verified"]) == (0, True)


def test_wind_is_set_on_the_command_line(optimised: Ran, tmp_path: Path) -> None:
    wind = ("--set", "environment.wind.from_deg=180", "--set", "environment.wind.speed_m_s=8")
    ran = inside("optimize", HALF_CUBAN, *ALONG_THE_PLAN, *wind, "--json", cwd=tmp_path)
    assert (ran.code, ran.answer["certified"]) == (0, True)
    assert ran.race_time != pytest.approx(optimised.race_time, abs=1e-3)


def test_show_prints_what_was_stored(optimised: Ran, run_file: Path, tmp_path: Path) -> None:
    ran = airrace("show", run_file, "--json", cwd=tmp_path)
    assert ran.code == 0
    assert ran.race_time == optimised.race_time
    stages = ran.answer["stages"]
    assert (ran.answer["verified"], stages[-1]["verification"]) == (True, "verified")
    only_in_show = ("legs", "laps", "verified", "verification")
    assert [{key: value for key, value in stage.items() if key not in only_in_show} for stage in stages] == (
        optimised.answer["stages"]
    )
    assert sum(leg["time_s"] for leg in stages[-1]["legs"]) == pytest.approx(optimised.race_time, abs=1e-9)
    certificate = inside("show", run_file, "--certificate", cwd=tmp_path)
    assert certificate.code == 0
    for name in ("0:entry", "1:vertical", "1:down_line", "1:upright", "1:exit", *CERTIFICATE):
        assert name in certificate.out


def test_verify_measures_the_stored_flight_again(optimised: Ran, run_file: Path, tmp_path: Path) -> None:
    ran = inside("verify", run_file, "--json", cwd=tmp_path)
    assert ran.code == 0
    assert ran.answer["verified"] is True
    stages = ran.answer["stages"]
    (stage,) = stages
    stored = {item["name"]: item["value"] for item in stage["stored"]["items"]}
    again = {item["name"]: item["value"] for item in stage["certificate"]["items"]}
    assert again == pytest.approx(stored, rel=1e-3, abs=1e-7)


READING = ("verify", "show", "sensitivity", "resume", "export csv", "export kml", "report", "plot")


@pytest.mark.parametrize("command", READING)
def test_damaged_checkpoint_is_refused_by_every_command_and_left_as_it_is(command: str, run_file: Path) -> None:
    content = bytearray(run_file.read_bytes())
    content[len(content) // 2] ^= 0x10
    run_file.write_bytes(content)
    ran = (airrace if command == "verify" else inside)(*command.split(), run_file, cwd=run_file.parent)
    assert (ran.code, ran.out) == (7, "")
    assert ran.err.startswith("airrace: ")
    assert run_file.read_bytes() == content
    assert list(run_file.parent.iterdir()) == [run_file]
    assert inside(*command.split(), "nowhere.h5", cwd=run_file.parent).code == 7


@pytest.mark.parametrize(
    "command", [("show",), ("report",), ("compare",), ("export", "csv"), ("export", "kml", "--origin", "45,13")]
)
def test_a_file_may_have_a_name_that_is_no_utf8(command: tuple[str, ...], run_file: Path) -> None:
    content = unseal(run_file.read_bytes())
    assert b"/half_cuban_eight.yaml" in content
    run_file.write_bytes(seal(content.replace(b"/half_cuban_eight.yaml", b"/half_cuban_\xe9ight.yaml")))
    names = [run_file, run_file] if command == ("compare",) else [run_file]
    ran = airrace(*command, *names, cwd=run_file.parent)
    assert (ran.code, ran.err) == (0, "")


def test_finished_run_is_flown_again_only_where_it_is_asked_for(run_file: Path, optimised: Ran) -> None:
    ran = inside("resume", run_file, *POINT_MASS, "--json", cwd=run_file.parent)
    assert ran.code == 0
    assert ran.race_time == optimised.race_time
    assert "started" not in ran.err
    ran = airrace("resume", run_file, *POINT_MASS, "--from", "point-mass", "--json", cwd=run_file.parent)
    assert ran.code == 0
    assert "point-mass: started" in ran.err
    assert ran.race_time == pytest.approx(optimised.race_time, rel=1e-9)


def table(text: str) -> tuple[list[str], list[dict[str, str]]]:
    """Comment lines and rows of an exported table."""
    comments = [line for line in text.splitlines() if line.startswith("#")]
    rows = [line for line in text.splitlines() if not line.startswith("#")]
    return comments, list(csv.DictReader(io.StringIO("\n".join(rows))))


def numbers(rows: list[dict[str, str]], column: str) -> list[float]:
    return [float(row[column]) for row in rows]


def test_exported_rate_meets_the_exported_mesh(run_file: Path) -> None:
    """Where a node and a sample are close in time, they are close in space."""
    _, mesh = table(inside("export", "csv", run_file, cwd=run_file.parent).out)
    _, rate = table(inside("export", "csv", run_file, "--rate", "1000", cwd=run_file.parent).out)
    samples = {round(float(row["time_s"]) * 1000): row for row in rate[:-1]}
    for row in mesh[:-1]:
        node = float(row["time_s"])
        nearest = samples[round(node * 1000)]
        late = float(nearest["time_s"]) - node
        rates = float(row["V_K_m_s"]) * abs(late)
        for axis in ("x_m", "y_m", "z_m"):
            assert abs(float(nearest[axis]) - float(row[axis])) <= rates + 1e-3


def test_exported_file_has_its_gate_splits_beside_it(optimised: Ran, run_file: Path) -> None:
    output = run_file.with_name("flight.csv")
    ran = inside("export", "csv", run_file, "--output", output, "-q", cwd=run_file.parent)
    assert (ran.code, ran.out) == (0, "")
    _, rows = table(output.read_text(encoding="utf-8"))
    _, splits = table(output.with_name("flight.splits.csv").read_text(encoding="utf-8"))
    assert [row["passage"] for row in splits] == ["0:entry", "1:vertical", "1:down_line", "1:upright", "1:exit"]
    assert float(splits[-1]["time_s"]) == float(rows[-1]["time_s"]) == pytest.approx(optimised.race_time, rel=1e-9)
    assert sum(numbers(splits, "leg_s")) == pytest.approx(optimised.race_time, rel=1e-9)
    before = output.read_bytes()
    assert inside("export", "csv", run_file, "--output", output, cwd=run_file.parent).code == 2
    assert output.read_bytes() == before


FASTER = ("--set", "rules.n_z_max=9.5")


@pytest.mark.slow
def test_changed_run_ends_where_a_run_from_scratch_ends_or_earlier(tmp_path: Path) -> None:
    plan = ("--guess", "plan", "--search", "off", "--quiet", "--json")
    before = airrace("optimize", HALF_CUBAN, *POINT_MASS, *plan, "--output", "RUN.h5", cwd=tmp_path)
    scratch = airrace("optimize", HALF_CUBAN, *POINT_MASS, *plan, *FASTER, "--output", "SCRATCH.h5", cwd=tmp_path)
    stored = (tmp_path / "RUN.h5").read_bytes()
    changed = airrace("resume", "RUN.h5", *FASTER, "--output", "NEW.h5", "--quiet", "--json", cwd=tmp_path)
    assert (changed.code, changed.answer["certified"]) == (0, True)
    assert (tmp_path / "RUN.h5").read_bytes() == stored
    assert changed.race_time <= scratch.race_time + 5e-3
    compared = changed.answer["compared"]
    assert isinstance(compared, dict)
    (flight,) = compared["flights"]
    difference = flight["difference_s"]
    assert difference == pytest.approx(changed.race_time - before.race_time, abs=1e-9)
    assert sum(leg["difference_s"] for leg in flight["legs"]) == pytest.approx(difference, abs=1e-6)
    assert airrace("verify", "NEW.h5", cwd=tmp_path).code == 0


def test_the_object_the_csv_and_the_table_tell_the_same_sensitivities(run_file: Path, tmp_path: Path) -> None:
    answer = inside("sensitivity", run_file, "--json", cwd=tmp_path).answer
    assert list(answer) == ["track", "stage", "race_time_s", "sensitivities"]
    found = answer["sensitivities"]
    rows = list(csv.DictReader(io.StringIO(inside("sensitivity", run_file, "--csv", cwd=tmp_path).out)))
    assert [row.pop("key") for row in rows] == list(found)
    told = [{name: "" if value is None else str(value) for name, value in one.items()} for one in found.values()]
    assert rows == told
    assert found["rules.start_speed_max_kt"]["s_per_unit"] < 0.0
    free = [key for key, one in found.items() if one["activity"] == "free"]
    table = inside("sensitivity", run_file, cwd=tmp_path).out
    assert f"free: {len(free)} more numbers of {len(found)}" in table
    assert max(map(len, table.splitlines())) <= 100
    assert "rules.start_speed_max_kt " in table
    assert not any(f"{key} " in table for key in free)
    group = inside("sensitivity", run_file, "--by", "rules", "--json", cwd=tmp_path).answer["sensitivities"]
    assert list(group) == [key for key in found if key.startswith("rules.")]
    assert {"rules.n_z_max", "rules.floor_m"} <= group.keys()


def test_sensitivities_that_there_are_not_are_refused(run_file: Path, tmp_path: Path) -> None:
    ran = inside("sensitivity", run_file, "--stage", "six-dof", cwd=tmp_path)
    assert (ran.code, ran.err) == (2, "airrace: this run has no stage 'six-dof'; it has: point-mass\n")
    assert inside("sensitivity", run_file, "--json", "--csv", cwd=tmp_path).code == 2
    assert inside("sensitivity", tmp_path / "none.h5", cwd=tmp_path).code == 7
    checkpoint = read_checkpoint(run_file)
    result = dataclasses.replace(checkpoint.stages[-1].result, outcome=Status.NOT_CERTIFIED)
    write_checkpoint(tmp_path / "open.h5", checkpoint.with_stage(result))
    ran = inside("sensitivity", "open.h5", "--json", cwd=tmp_path)
    assert ran.code == 5
    assert ran.err == "airrace: point-mass is not certified: only a certified or solved stage has sensitivities\n"
    assert ran.answer["error"] == "point-mass is not certified: only a certified or solved stage has sensitivities"
