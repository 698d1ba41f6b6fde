"""Help, and the commands doctor and schema."""

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml
from typer.testing import CliRunner

from airrace.api import courses
from airrace.cli import installation
from airrace.cli.main import app
from airrace.files.inputs.json_schema import LANGUAGES, json_schema

ROOT = Path(__file__).parents[2]
COMMAND_LINE = (ROOT / "docs" / "command_line.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEXTS = "\n".join(path.read_text(encoding="utf-8") for path in PAGES)
"""Everything that a user reads, but for the pages that are generated."""
HEAVY = ("casadi", "h5py", "matplotlib", "numpy", "pydantic", "rich", "scipy", "yaml")


@pytest.mark.parametrize("arguments", [["--help"], ["--version"]])
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    program = (
        "import atexit, sys\n"
        "from airrace.__main__ import main\n"
        f"loaded = lambda: [name for name in {HEAVY!r} if name in sys.modules]\n"
        "atexit.register(lambda: print(loaded(), file=sys.stderr))\n"
        f"sys.argv = ['airrace', *{arguments!r}]\n"
        "main()\n"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout
    assert ran.stderr.splitlines()[-1] == "[]"


def test_a_run_does_not_wait_for_scipy() -> None:
    """It takes a quarter of a second to load, and is wanted at the replay only: it loads beside the solve."""
    program = "import sys, airrace.cli.optimize, airrace.runs, airrace.files.inputs; print('scipy' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["False"]


def commands() -> Iterator[tuple[str, list[str]]]:
    """Every command with its options, as a user types them."""

    def walk(command: object, path: str) -> Iterator[tuple[str, list[str]]]:
        children = getattr(command, "commands", None)
        if children:
            for name, child in children.items():
                yield from walk(child, f"{path} {name}")
            return
        options = [max(parameter.opts, key=len) for parameter in command.params]
        yield path, [option for option in options if option.startswith("--") and option != "--help"]

    yield from walk(typer.main.get_command(app), "airrace")


@pytest.mark.parametrize("command", [name for name, _ in commands()])
def test_every_command_is_documented(command: str) -> None:
    assert re.search(
        rf"^    {command} (\S+\.(yaml|h5)|track|NAME|LOG --course TRACK|LOG)?( --\S+ \S+)* +\w",
        COMMAND_LINE,
        re.MULTILINE,
    )


def test_every_option_is_documented() -> None:
    known = {option for _, options in commands() for option in options}
    assert {option for option in known if f"`{option}" not in TEXTS and f", `{option}" not in TEXTS} == set()


def test_the_action_calls_commands_as_they_are() -> None:
    action = yaml.safe_load((ROOT / ".github" / "actions" / "fly" / "action.yml").read_text(encoding="utf-8"))
    scripts = "\n".join(step.get("run", "") for step in action["runs"]["steps"])
    called = re.findall(r"airrace (batch|report) (.*?)(?: \|\||$)", scripts, re.MULTILINE)
    assert [command for command, _ in called] == ["batch", "report"]
    for command, arguments in called:
        options = {word for word in shlex.split(arguments) if word.startswith("--")}
        assert options <= set(dict(commands())[f"airrace {command}"])
        assert options


def examined() -> tuple[int, dict[str, dict[str, str]], dict[str, Any]]:  # Any: JSON
    ran = CliRunner().invoke(app, ["doctor", "--json"])
    told = json.loads(ran.stdout)
    return ran.exit_code, {one["name"]: one for one in told["components"]}, told


def test_an_installation_that_works_is_healthy() -> None:
    code, components, told = examined()
    assert (code, told["healthy"]) == (0, True)
    assert {"Python", "airrace", "casadi", "numpy", "typer", "native library", "cores", "solver"} <= set(components)
    assert components["casadi"]["found"] == version("casadi")
    assert components["solver"]["found"].startswith("a known answer in ")
    assert "pytest" not in components


def test_a_wrong_answer_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    class Wrong:
        objective, status = 1.9, "Solve_Succeeded"

    monkeypatch.setattr(installation, "solve", lambda *_: Wrong())
    code, components, told = examined()
    assert (code, told["healthy"]) == (1, False)
    assert components["solver"]["fault"] == "1.900000 s instead of 2 s (Solve_Succeeded)"
    assert told["error"] == "this installation does not work: solver"


def test_what_is_missing_is_reported_with_what_needs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def without(name: str) -> str:
        if name in ("matplotlib", "h5py"):
            raise PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(installation, "version", without)
    monkeypatch.setattr(installation, "solve_known_problem", lambda: "a known answer")
    code, components, _ = examined()
    assert code == 1
    assert components["h5py"]["fault"] == "it is not installed"
    assert components["matplotlib"]["fault"] == ""
    assert components["matplotlib"]["needed_for"].startswith("plot, check --plot")
    assert (
        "missing, needed for plot, check --plot, compare --plot: pip install"
        in CliRunner().invoke(app, ["doctor"]).stdout
    )


def test_the_variant_of_the_native_library_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    assert installation.native_variant() in ("baseline", "avx2", "avx512")
    monkeypatch.setattr(installation, "library", lambda: None)
    assert installation.native_variant() == "none: casadi evaluates, some ten times slower"


def test_every_language_is_printed_as_one_object_and_another_one_refused() -> None:
    assert tuple(LANGUAGES) == courses.LANGUAGES
    for language in LANGUAGES:
        ran = CliRunner().invoke(app, ["schema", language])
        assert (ran.exit_code, ran.stderr) == (0, "")
        assert json.loads(ran.stdout) == json_schema(language)
    ran = CliRunner().invoke(app, ["schema", "wind"])
    assert ran.exit_code == 2
    assert all(language in ran.stderr for language in LANGUAGES)
