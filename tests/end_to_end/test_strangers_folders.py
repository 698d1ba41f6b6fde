"""A folder that comes from anybody holds files with the names of Python's modules: none of them is ever run."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from airrace_command import ALONG_THE_PLAN, HALF_CUBAN, POINT_MASS, ROOT, airrace
from clusters import Cluster
from kept import kept

COURSE = "course.yaml"
LOG = "log.csv"
RUN = "run.h5"
MARK = "executed"
BATCH_ALONG_THE_PLAN = (*POINT_MASS, "--set", "settings.guess=plan", "--set", "settings.explore=off")
NAMES = ("numpy", "types")
"""A library's, which processes import late, and one of those that Python itself imports as it starts."""
LEAVES_A_MARK = f"open(__file__ + '.{MARK}', 'w').close()\n"


@kept
def run_file() -> bytes:
    """A run of the course, flown in such a folder."""
    with tempfile.TemporaryDirectory() as folder:
        place = strangers(Path(folder))
        ran = airrace("optimize", COURSE, *ALONG_THE_PLAN, "--out", RUN, cwd=place)
        assert ran.code == 0, ran.err
        assert_nothing_was_executed(place)
        return (place / RUN).read_bytes()


def strangers(folder: Path) -> Path:
    """Fill a folder as a stranger might."""
    shutil.copy(HALF_CUBAN, folder / COURSE)
    shutil.copy(ROOT / "tests" / "logs" / "rovinj_2014.csv", folder / LOG)
    for name in NAMES:
        (folder / f"{name}.py").write_text(LEAVES_A_MARK, encoding="utf-8")
    return folder


def assert_nothing_was_executed(folder: Path) -> None:
    assert not list(folder.glob(f"*.{MARK}"))
    assert not (folder / "__pycache__").exists()


def test_a_process_that_looks_for_modules_there_does_run_them(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "airrace", "tracks"], cwd=strangers(tmp_path), capture_output=True, check=False
    )
    assert list(tmp_path.glob(f"*.{MARK}"))


@pytest.mark.parametrize(
    "command",
    [
        ("optimize", COURSE, *ALONG_THE_PLAN, "--explore", "quick", "--threads", "2"),
        ("resume", RUN, "--from", "point-mass", *POINT_MASS),
        ("batch", COURSE, *BATCH_ALONG_THE_PLAN),
        *(("export", form, RUN) for form in ("csv", "parquet", "netcdf", "mat")),
        *(("export", form, RUN, "--origin", "45,16,150") for form in ("kml", "acmi", "fdr", "czml", "gpx", "geojson")),
        ("import", LOG, "--course", "rovinj_2014"),
        ("report", RUN),
        ("report", RUN, "--prices", "--output", "prices.html"),
        ("show", RUN),
        ("compare", RUN, RUN),
        ("compare", RUN, RUN, "--plot", "compared.svg"),
        ("plot", RUN),
        ("verify", RUN),
        ("prices", RUN),
        ("check", COURSE),
        ("tracks",),
        ("init", "mine"),
        ("schema", "track"),
        ("--help",),
    ],
    ids=" ".join,
)
def test_no_command_runs_a_file_of_the_folder_in_which_one_stands(command: tuple[str, ...], tmp_path: Path) -> None:
    (strangers(tmp_path) / RUN).write_bytes(run_file())
    ran = airrace(*command, cwd=tmp_path)
    assert ran.code == 0, ran.err
    assert_nothing_was_executed(tmp_path)


@pytest.mark.slow
def test_no_worker_of_a_cluster_does_either(tmp_path: Path) -> None:
    with Cluster(strangers(tmp_path)) as cluster:
        cluster.worker()
        ran = airrace("batch", COURSE, *BATCH_ALONG_THE_PLAN, "--cluster", cluster.address, cwd=tmp_path)
    assert ran.code == 0, ran.err
    assert_nothing_was_executed(tmp_path)
