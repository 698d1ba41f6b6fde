"""`airrace` in this process, and what a command leaves behind that has ended."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from airrace.cli.main import app


@dataclass(frozen=True)
class Ran:
    """A command that has ended."""

    code: int
    out: str
    err: str

    @property
    def answer(self) -> dict[str, Any]:
        """The one object on stdout."""
        assert self.out.count("\n") == 1, self.out
        return json.loads(self.out)

    @property
    def race_time(self) -> float:
        return self.answer["race_time_s"]

    @property
    def stages(self) -> list[str]:
        """Names of the stages in the answer."""
        return [stage["stage"] for stage in self.answer["stages"]]

    @property
    def states(self) -> dict[str, str]:
        """How the jobs of a batch ended, by their names."""
        return {job["name"]: job["state"] for job in self.answer["jobs"]}


def run(*arguments: str | Path) -> Ran:
    """Run the command, where neither its signals nor its streams are what is looked at."""
    ran = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert ran.exception is None or isinstance(ran.exception, SystemExit), ran.exception
    return Ran(ran.exit_code, ran.stdout, ran.stderr)
