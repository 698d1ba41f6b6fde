"""The command line needs nothing that POSIX alone has, nor a console that knows every character.

What another system lacks is taken from every module of airrace, in all of its processes; see
`without_posix/sitecustomize.py`.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from airrace_command import HALF_CUBAN, Ran, airrace
from every_command import BATCH, COMMANDS, OPTIMIZE, RUN, furnish

ELSEWHERE = {
    "PYTHONPATH": str(Path(__file__).with_name("without_posix")),
    "PYTHONIOENCODING": "cp1252",
    "PYTHONWARNDEFAULTENCODING": "1",  # files that are opened without an encoding are an error
}


def elsewhere(*arguments: str | Path, cwd: Path) -> Ran:
    return airrace(*arguments, cwd=cwd, environment=ELSEWHERE)


@pytest.mark.parametrize(
    ("use", "error"),
    [
        ("import fcntl", "ModuleNotFoundError"),
        ("import os; os.geteuid()", "AttributeError"),
        ("from signal import SIGKILL", "ImportError"),
        ("import ctypes; ctypes.CDLL(None)", "TypeError"),
        ("import subprocess; subprocess.Popen([], pass_fds=(3,))", "ValueError"),
        ("from pathlib import Path; Path('x').read_text()", "EncodingWarning"),
    ],
)
def test_the_system_lacks_for_airrace_what_it_has_for_others(use: str, error: str) -> None:
    def error_in(module: str) -> str:
        program = f"exec({use!r}, {{'__name__': {module!r}}})"
        environment = {**os.environ, **ELSEWHERE}
        return subprocess.run(
            [sys.executable, "-P", "-c", program], env=environment, capture_output=True, text=True, check=False
        ).stderr

    assert f"\n{error}: " in error_in("airrace.probe")
    assert f"\n{error}: " not in error_in("probe")


@pytest.mark.parametrize("command", [OPTIMIZE, BATCH, ("show", RUN)], ids=" ".join)
def test_courses_are_flown_and_certified(command: tuple[str, ...], tmp_path: Path) -> None:
    ran = elsewhere(*command, cwd=furnish(tmp_path))
    assert ran.code == 0, ran.err


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_passes(command: tuple[str, ...], tmp_path: Path) -> None:
    ran = elsewhere(*command, cwd=furnish(tmp_path))
    assert ran.code == 0, ran.err


@pytest.mark.slow
@pytest.mark.parametrize("command", [("optimize",), ("batch",)], ids=" ".join)
def test_all_fidelities_are_certified(command: tuple[str, ...], tmp_path: Path) -> None:
    ran = elsewhere(*command, HALF_CUBAN, "--json", cwd=tmp_path)
    assert ran.code == 0, ran.err
    assert ran.answer["certified"] is True
