"""`airrace` as users call it: the installed command in a process of its own."""

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from command import Ran, run

ROOT = Path(__file__).parents[2]
HALF_CUBAN = ROOT / "tracks" / "half_cuban_eight.yaml"
SIXTEEN = ROOT / "tracks" / "sixteen_phases.yaml"
AIRCRAFT = ROOT / "configs" / "edge540.yaml"
POINT_MASS = ("--until", "point-mass")
"""Options of a run that stops before the inner loops."""
ALONG_THE_PLAN = (*POINT_MASS, "--guess", "plan", "--search", "off")
"""Options of the shortest run there is."""
COMMAND = str(Path(sys.executable).parent / "airrace")


def airrace(
    *arguments: str | Path,
    cwd: Path,
    environment: Mapping[str, str] | None = None,
    before: Callable[[], None] | None = None,
) -> Ran:
    """Run the command to its end; `before` runs in the new process just before it."""
    ran = subprocess.run(
        [COMMAND, *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, **(environment or {})},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=300.0,
        preexec_fn=before,
    )
    assert "Traceback" not in ran.stderr, ran.stderr
    return Ran(ran.returncode, ran.stdout, ran.stderr)


def inside(*arguments: str | Path, cwd: Path) -> Ran:
    """Run the command in this process, where neither its signals nor its streams are what is looked at."""
    with contextlib.chdir(cwd):
        return run(*arguments)


def start(*arguments: str | Path, cwd: Path) -> subprocess.Popen[str]:
    """Start the command and return at once."""
    return subprocess.Popen(
        [COMMAND, *map(str, arguments)],
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for(running: subprocess.Popen[str], text: str) -> None:
    """Read the progress until a line holds the text."""
    assert running.stderr is not None
    for line in running.stderr:
        if text in line:
            return
    raise AssertionError(f"ended with {running.wait()} before it printed {text!r}")


def children(of: int) -> list[int]:
    """Processes that a process has started (Linux)."""
    processes: list[int] = []
    for task in Path(f"/proc/{of}/task").iterdir():
        processes += [int(child) for child in (task / "children").read_text().split()]
    return processes
