"""The wheel holds all that is needed: in an empty folder, with nothing but it, courses are flown by their names."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PYTHON = """
import airrace
run = airrace.optimize("half_cuban_eight", until="point-mass", search="off")
print(airrace.__file__, run.certified, run.save("flown.h5"), len(run.splits), len(run["point-mass"].to_dataframe()))
"""


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds the package as the wheel installs it, and nothing else of this tree."""
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def test_the_wheel_holds_courses_aircraft_rules_types_and_sources(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    for folder in ("tracks", "configs"):
        files = sorted((ROOT / folder).glob("*.yaml"))
        assert {f"airrace/shipped/{folder}/{file.name}" for file in files} <= names
    assert {
        "airrace/py.typed",
        "airrace/__main__.py",
        "airrace/files/inputs/presets/rbar-2014.yaml",
        "airrace/files/inputs/templates/course.yaml",
        "airrace/files/export/aircraft.glb",
        "airrace/files/export/aircraft.dae",
        "airrace/optimal_control/native/airrace_native.so",
        "airrace/pages/report/page.html",
        "airrace/pages/report/script/main.js",
        "airrace/pages/report/style/page.css",
        "airrace/pages/report/libraries/three/three.module.min.js",
        "airrace/pages/report/libraries/three/LICENSE",
    } <= names
    assert not [name for name in names if name.startswith(("tests/", "tracks/", "configs/")) or name.endswith(".c")]
    assert wheel.name.split("-")[2:4] == ["py3", "none"]  # one wheel serves every Python of a platform


def test_without_a_compiler_the_package_is_built_without_its_library(tmp_path: Path) -> None:
    shutil.copytree(ROOT, tmp_path / "source", ignore=shutil.ignore_patterns(".*", "build", "tests", "docs", "*.so"))
    program = f"from scikit_build_core.build import build_wheel; build_wheel({str(tmp_path)!r})"
    environment = {**os.environ, "CC": str(tmp_path / "no-compiler")}
    subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path / "source", env=environment, capture_output=True, check=True
    )
    (wheel,) = tmp_path.glob("*-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert "airrace/optimal_control/native/library.py" in names
    assert not [name for name in names if name.endswith(".so")]


def run(installed: Path, folder: Path, *arguments: str) -> str:
    """Python with the installed package in an empty folder; what it printed."""
    ran = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def test_what_comes_along_is_found_in_the_installed_package(installed: Path, tmp_path: Path) -> None:
    listed = json.loads(run(installed, tmp_path, "-m", "airrace", "tracks", "--json"))
    assert [one["name"] for one in listed["tracks"]] == sorted(path.stem for path in (ROOT / "tracks").glob("*.yaml"))
    where = run(installed, tmp_path, "-c", "from airrace.files.inputs.document import TRACKS; print(TRACKS.path)")
    assert Path(where.strip()) == installed / "airrace" / "shipped" / "tracks"


@pytest.mark.slow
def test_a_course_is_flown_in_an_empty_folder_through_every_door(installed: Path, tmp_path: Path) -> None:
    until = ("--until", "point-mass", "--json")
    flown = json.loads(run(installed, tmp_path, "-m", "airrace", "optimize", "rovinj_2014", *until))
    assert flown["certified"] is True
    where, certified, saved, *_ = run(installed, tmp_path, "-c", PYTHON).split()
    assert Path(where).is_relative_to(installed)
    assert (certified, saved) == ("True", "flown.h5")
    run(installed, tmp_path, "-m", "airrace", "init", "sprint")
    sprint = json.loads(run(installed, tmp_path, "-m", "airrace", "optimize", "sprint.yaml", *until))
    assert sprint["certified"] is True
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "flown.h5",
        "rovinj_2014.h5",
        "sprint.h5",
        "sprint.yaml",
        "track.schema.json",
    ]
