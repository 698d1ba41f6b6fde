"""`airrace batch` as a shell would call it, its jobs flown by stand-ins."""

import json
import subprocess
import sys
from pathlib import Path

from batch_examples import STAND_IN
from typer.testing import CliRunner

from airrace.cli.main import app

PROGRAM = f"""
import airrace.batch.process as process
process.JOB_COMMAND = {STAND_IN!r}
process.GRACE = 600.0  # whoever waits for its end waits longer than any test does
from airrace.__main__ import main
main()
"""


class Shell:
    """`airrace batch --until point-mass` in a folder of its own, with a course `oval.yaml` in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.out = folder / "batch"

    def __call__(self, *arguments: str | Path) -> "Ran":
        result = CliRunner().invoke(app, ["batch", "--until", "point-mass", *map(str, arguments)])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        return Ran(result.exit_code, result.stdout, result.stderr)

    def start(self, *arguments: str | Path) -> subprocess.Popen[str]:
        """In a process of its own."""
        return subprocess.Popen(
            [sys.executable, "-c", PROGRAM, "batch", "--until", "point-mass", *map(str, arguments)],
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )


class Ran:
    """A command that has ended."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err

    @property
    def answered(self) -> dict:
        """The one object on stdout."""
        assert self.out.count("\n") == 1
        return json.loads(self.out)

    @property
    def states(self) -> dict[str, str]:
        return {job["name"]: job["state"] for job in self.answered["jobs"]}
