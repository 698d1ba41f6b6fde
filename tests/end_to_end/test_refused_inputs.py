"""What cannot be flown is told at once: where it stands, what it should be, and by its own exit code."""

import json
import resource
import shutil
from pathlib import Path

import pytest
from airrace_command import AIRCRAFT, ALONG_THE_PLAN, HALF_CUBAN, POINT_MASS, ROOT, airrace, inside

ROVINJ = ROOT / "tracks" / "rovinj_2014.yaml"


@pytest.fixture
def course(tmp_path: Path) -> Path:
    """A folder with a track and its aircraft, to be spoilt."""
    for folder, source in (("tracks", ROVINJ), ("configs", AIRCRAFT)):
        (tmp_path / folder).mkdir()
        shutil.copy(source, tmp_path / folder)
    spoil(tmp_path / "tracks" / ROVINJ.name, "aircraft: edge540", "aircraft: ../configs/edge540.yaml")
    return tmp_path / "tracks" / ROVINJ.name


def spoil(path: Path, old: str, new: str) -> int:
    """Replace text in a file once; the line it stands in."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return text[: text.index(old)].count("\n") + 1


GATE = ("tracks/rovinj_2014.yaml", "north_m: 955.0, ", "")
RULES = ("tracks/rovinj_2014.yaml", "rules: rbar-2014")
LIFT = "configs/edge540.yaml"


@pytest.mark.parametrize(
    ("file", "old", "new", "at_its_line", "key", "message"),
    [
        (*GATE, True, "gates.g4.north_m", "missing"),
        (*RULES, "rules: {preset: rbar-2014, n_z_mx: 10}", True, "", "n_z_max"),
        (*RULES, "rules:\n  preset: rbar-2014\n  n_z_min: -2\n  n_z_min: -3", False, "", "n_z_min"),
        (*RULES, "rules: {preset: rbar-2014, floor_m: 90}", False, "gates.g0", "floor"),
        (RULES[0], "../configs/edge540.yaml", "../configs/edge541.yaml", True, "aircraft", "edge541.yaml"),
        (LIFT, "\nlift:\n", "\nlift_:\n", False, "lift", ""),
        (LIFT, "C_L_max: 1.40", "C_L_max: 0.01", False, "C_L_max", ""),
    ],
    ids=["field", "key", "twice", "floor", "aircraft", "no lift", "little lift"],
)
def test_commands_refuse_a_spoilt_file_alike_and_write_nothing(
    file: str,
    old: str,
    new: str,
    at_its_line: bool,
    key: str,
    message: str,
    course: Path,
    request: pytest.FixtureRequest,
) -> None:
    line = spoil(course.parents[1] / file, old, new)
    run = airrace if key == "gates.g4.north_m" else inside
    flown, checked = (run(command, course, "--json", cwd=course.parent) for command in ("optimize", "check"))
    assert flown.code == checked.code == 3
    assert flown.answer["findings"] == checked.answer["findings"]
    assert not list(course.parent.glob("*.h5"))
    found = [one for one in flown.answer["findings"] if not at_its_line or one["line"] == line]
    assert any(key in one["key"] and message in f"{one['key']} {one['message']}" for one in found), found


@pytest.mark.parametrize("arguments", [("nowhere.yaml",), (ROVINJ, "--aircraft", "nowhere.yaml")])
def test_missing_file_is_named(arguments: tuple[str | Path, ...], tmp_path: Path) -> None:
    ran = inside("optimize", *arguments, "--json", cwd=tmp_path)
    assert ran.code == 3
    assert "nowhere.yaml" in ran.err


@pytest.mark.slow
def test_course_that_cannot_be_flown_is_infeasible_and_says_which_limit(tmp_path: Path) -> None:
    limit = ("--set", "rules.ceiling_m=100")
    ran = airrace("optimize", HALF_CUBAN, *ALONG_THE_PLAN, *limit, "--json", cwd=tmp_path)
    assert ran.code == 4
    assert ran.answer["certified"] is False
    assert ran.stages == ["point-mass"]
    (conflict,) = ran.answer["stages"][0]["conflicts"]
    change = conflict["suggested_changes"][0]
    assert (change["key"], change["certified"]) == ("rules.ceiling_m", True)
    assert 179.0 < change["needed"] < 300.0  # it takes 179 m without a floor at the height of the entry
    setting = f"(rules.ceiling_m={change['needed']:g})"
    assert f"{conflict['where']} cannot be flown with the ceiling of 100 m: " in str(ran.answer["error"])
    assert setting in str(ran.answer["error"])
    assert "pilot" not in str(ran.answer["error"])
    shown = airrace("show", tmp_path / "half_cuban_eight.h5", "--json", cwd=tmp_path)
    assert shown.code == 0
    assert shown.answer["certified"] is False


def test_flight_that_is_not_certified_is_no_success(tmp_path: Path) -> None:
    strict = ("--set", "settings.certificate.replay=1e-13", "--set", "settings.mesh.refinements_max=0")
    ran = airrace("optimize", HALF_CUBAN, *ALONG_THE_PLAN, *strict, "--json", cwd=tmp_path)
    assert ran.code == 5
    assert ran.answer["certified"] is False
    assert "replay_defect" in str(ran.answer["error"])
    assert airrace("verify", tmp_path / "half_cuban_eight.h5", "--json", cwd=tmp_path).code == 5


def small_files(limit: int) -> None:
    """No file may grow beyond so many bytes, as on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))


def test_full_disk_ends_a_run_with_its_own_code(tmp_path: Path) -> None:
    ran = airrace("optimize", HALF_CUBAN, *ALONG_THE_PLAN, "--json", cwd=tmp_path, before=lambda: small_files(4096))
    assert ran.code == 8
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_full_disk_leaves_the_old_checkpoint_as_it_was(tmp_path: Path) -> None:
    assert airrace("optimize", HALF_CUBAN, *ALONG_THE_PLAN, "--quiet", cwd=tmp_path).code == 0
    run_file = tmp_path / "half_cuban_eight.h5"
    before = run_file.read_bytes()
    limit = len(before) - 1000
    again = ("resume", run_file, *POINT_MASS, "--from", "point-mass", "--json")
    ran = airrace(*again, cwd=tmp_path, before=lambda: small_files(limit))
    assert ran.code == 8
    assert list(tmp_path.iterdir()) == [run_file]
    assert json.loads(airrace("show", run_file, "--json", cwd=tmp_path).out)
