"""Changes of the code that the pages describe can be made to it as it is, and do what is said of them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pages import ROOT, blocks

DIFFS = blocks("diff")
TRACK = ROOT / "tracks" / "half_cuban_eight.yaml"


def changed(diff: str, root: Path) -> None:
    """Make the changes of a diff whose hunks carry no line numbers: each must fit in exactly one place."""
    for part in diff.split("--- ")[1:]:
        name, *hunks = part.split("@@\n")
        path = root / name.strip()
        text = path.read_text(encoding="utf-8")
        for hunk in hunks:
            lines = hunk.splitlines(keepends=True)
            before = "".join(line[1:] for line in lines if line[0] in " -")
            assert text.count(before) == 1, f"{name.strip()}: {before}"
            text = text.replace(before, "".join(line[1:] for line in lines if line[0] in " +"))
        path.write_text(text, encoding="utf-8")


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with a copy of the package, and of what comes along with it."""
    for folder in ("airrace", "tracks", "configs"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


LIMIT = """
import sys
from pathlib import Path

from airrace.inputs import load_inputs
from airrace.dynamics.limits import flight_limits

race = load_inputs(Path(sys.argv[1]), overrides=[sys.argv[2]]).race
print(flight_limits(race.aircraft, race.course.rules).V_K.upper * 3600 / 1852)
"""


def said(package: Path, override: str) -> subprocess.CompletedProcess[str]:
    """The highest speed, in knots, under one more rule."""
    return subprocess.run(
        [sys.executable, "-c", LIMIT, str(TRACK), override],
        cwd=package,
        env={**os.environ, "PYTHONPATH": str(package)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_speed_limit_is_added_as_the_page_says(package: Path) -> None:
    (diff,) = (block for block in DIFFS if block.page == "docs/how_to/limit.md")
    unknown = said(package, "rules.speed_max_kt=200")
    assert "unknown key" in unknown.stderr
    changed(diff.text, package)
    assert float(said(package, "rules.speed_max_kt=200").stdout) == pytest.approx(200.0)
    assert float(said(package, "rules.n_z_max=9").stdout) > 200.0
    contradiction = said(package, "rules.speed_max_kt=60")
    assert "V_K: no value satisfies both" in contradiction.stderr


def test_a_change_that_does_not_fit_is_found(package: Path) -> None:
    with pytest.raises(AssertionError, match=r"limits\.py"):
        changed("--- airrace/dynamics/limits.py\n@@\n-        V_K=nothing\n+        V_K=1\n", package)
