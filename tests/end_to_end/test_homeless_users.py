"""A user whom the system does not know, without a home, can fly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

POINT_MASS = ("--until", "point-mass", "--guess", "plan", "--set", "settings.search=off")
ROOT = Path(__file__).parents[2]
UNKNOWN = """
import pwd, sys

def unknown(number):
    raise KeyError(f"getpwuid(): uid not found: {number}")

pwd.getpwuid = unknown
from pathlib import Path
try:
    Path.home()
except RuntimeError:
    pass
else:
    raise AssertionError("this user has a home")
sys.argv = ["airrace", *sys.argv[1:]]
from airrace.__main__ import main
main()
"""
"""The command in a process for which the list of users is empty."""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such list")
def test_user_without_a_home_and_without_a_name_can_fly(tmp_path: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-c", UNKNOWN, "optimize", "half_cuban_eight", *POINT_MASS, "--output", "run.h5"],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        cwd=tmp_path,
        env={"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "TMPDIR": str(tmp_path)},
    )
    assert ran.returncode == 0, ran.stderr
    assert "Traceback" not in ran.stderr
    assert (tmp_path / "run.h5").exists()
