"""What cannot be flown is told at once: where it stands, what it should be, and by its own exit code."""

import json
import resource
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from airrace_command import AIRCRAFT, ALONG_THE_PLAN, HALF_CUBAN, POINT_MASS, ROOT, Ran, airrace, inside

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


def refused(track: Path, run: Callable[..., Ran] = inside) -> Ran:
    """Both commands that read a track refuse it with the same findings, and nothing is written."""
    flown = run("optimize", track, "--json", cwd=track.parent)
    checked = run("check", track, "--json", cwd=track.parent)
    assert flown.code == checked.code == 3
    assert flown.answer["findings"] == checked.answer["findings"]
    assert not list(track.parent.glob("*.h5"))
    return flown


def findings(ran: Ran) -> list[dict[str, object]]:
    found = ran.answer["findings"]
    assert isinstance(found, list)
    return found


def test_missing_gate_field_is_named(course: Path) -> None:
    line = spoil(course, "north_m: 955.0, ", "")
    (finding,) = findings(refused(course, airrace))
    assert finding["line"] == line
    assert finding["key"] == "gates.g4.north_m"
    assert "missing" in str(finding["message"])


def test_unknown_key_is_answered_with_a_suggestion(course: Path) -> None:
    line = spoil(course, "rules: rbar-2014", "rules: {preset: rbar-2014, n_z_mx: 10}")
    found = findings(refused(course))
    unknown = [one for one in found if one["line"] == line]
    assert any("n_z_max" in str(one["message"]) for one in unknown)


def test_duplicate_key_is_told_with_its_line(course: Path) -> None:
    spoil(course, "rules: rbar-2014", "rules:\n  preset: rbar-2014\n  n_z_min: -2\n  n_z_min: -3")
    found = findings(refused(course))
    assert any("n_z_min" in f"{one['key']} {one['message']}" for one in found)


def test_missing_aircraft_file_is_named(course: Path) -> None:
    line = spoil(course, "../configs/edge540.yaml", "../configs/edge541.yaml")
    (finding,) = findings(refused(course))
    assert (finding["key"], finding["line"]) == ("aircraft", line)
    assert "edge541.yaml" in str(finding["message"])


def test_missing_aircraft_file_on_the_command_line_is_named(course: Path) -> None:
    ran = inside("optimize", course, "--aircraft", "nowhere.yaml", "--json", cwd=course.parent)
    assert ran.code == 3
    assert "nowhere.yaml" in ran.err


def test_aircraft_without_lift_is_refused(course: Path) -> None:
    aircraft = course.parents[1] / "configs" / AIRCRAFT.name
    text = aircraft.read_text(encoding="utf-8")
    begin, end = text.index("lift:\n"), text.index("drag:\n")
    aircraft.write_text(text[:begin] + text[end:], encoding="utf-8")
    found = findings(refused(course))
    assert any(one["key"] == "lift" for one in found)


def test_aircraft_whose_lift_does_not_carry_it_is_refused(course: Path) -> None:
    spoil(course.parents[1] / "configs" / AIRCRAFT.name, "C_L_max: 1.40", "C_L_max: 0.01")
    assert any("C_L_max" in str(one["key"]) for one in findings(refused(course)))


def test_gate_below_the_floor_is_refused_by_name(course: Path) -> None:
    spoil(course, "rules: rbar-2014", "rules: {preset: rbar-2014, floor_m: 90}")
    found = findings(refused(course))
    assert any("gates.g0" in str(one["key"]) and "floor" in str(one["message"]) for one in found)


def test_missing_track_is_named(tmp_path: Path) -> None:
    ran = inside("optimize", "nowhere.yaml", "--json", cwd=tmp_path)
    assert ran.code == 3
    assert "nowhere.yaml" in ran.err


def test_course_that_cannot_be_flown_is_infeasible_and_says_which_limit(tmp_path: Path) -> None:
    limit = ("--set", "rules.ceiling_m=100")
    ran = airrace("optimize", HALF_CUBAN, *ALONG_THE_PLAN, *limit, "--json", cwd=tmp_path)
    assert ran.code == 4
    assert ran.answer["certified"] is False
    assert "cannot be flown with the ceiling of 100 m: it takes 1" in str(ran.answer["error"])
    assert ran.stages == ["point-mass"]
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
    ran = airrace(
        "resume",
        run_file,
        *POINT_MASS,
        "--from",
        "point-mass",
        "--json",
        cwd=tmp_path,
        before=lambda: small_files(limit),
    )
    assert ran.code == 8
    assert list(tmp_path.iterdir()) == [run_file]
    assert json.loads(airrace("show", run_file, "--json", cwd=tmp_path).out)
