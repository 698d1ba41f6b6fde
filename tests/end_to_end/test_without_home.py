"""A user without $HOME and without an entry in the list of users can solve a race."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from airrace_command import ALONG_THE_PLAN, ROOT

UNKNOWN_USER = """
import pwd, sys

def unknown(number):
    raise KeyError(number)

pwd.getpwuid = unknown
from pathlib import Path
try:
    Path.home()
except RuntimeError:
    from airrace.__main__ import main
    main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such list")
def test_user_without_home_and_name_can_solve_a_race(tmp_path: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-c", UNKNOWN_USER, "optimize", "half_cuban_eight", *ALONG_THE_PLAN, "--output", "run.h5"],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        cwd=tmp_path,
        env={"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "TMPDIR": str(tmp_path)},
    )
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "run.h5").exists()
