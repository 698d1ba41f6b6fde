"""No command writes over a file that it reads, with `--force` or without, by whatever path or link it is named."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fake_optimizer
import pytest
import typer.main
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.pages.report import film

ROOT = Path(__file__).parents[2]
RUN = "run.h5"
INPUTS = "--aircraft other.yaml --settings settings.yaml"
LOG = "import log.csv --course course.yaml --mapping mapping.yaml"
KML = "kml run.h5 log.csv --origin 45,13"

COMMANDS: dict[str, str] = {
    f"optimize course.yaml {INPUTS} --start run.h5 --output OUT": ("course.yaml other.yaml settings.yaml run.h5"),
    "optimize course --output OUT": "course.yaml plane.yaml extension.py",
    f"resume run.h5 --track course.yaml {INPUTS} --output OUT": (
        "run.h5 course.yaml other.yaml settings.yaml extension.py"
    ),
    "resume run.h5 --track course.yaml --aircraft plane --output OUT": "plane.yaml",
    f"check course.yaml {INPUTS} --plot OUT.png": "course.yaml other.yaml settings.yaml extension.py",
    "check course --plot OUT.png": "course.yaml plane.yaml",
    "compare run.h5 run.h5:homotopy log.csv --plot OUT.png": "run.h5 log.csv",
    "plot run.h5:point-mass --output OUT.png": "run.h5",
    "report run.h5 run.h5:homotopy log.csv --output OUT": "run.h5 log.csv",
    "export csv run.h5:point-mass --output OUT": "run.h5",
    "footprint run.h5:point-mass --output OUT.csv": "run.h5",
    "safety run.h5 --output OUT.json": "run.h5",
    "safety course.yaml --aircraft other.yaml --output OUT.json": "course.yaml other.yaml",
    "film run.h5 --output OUT.mp4": "run.h5",
    "card run.h5 --output OUT.png": "run.h5",
    "sweep run.h5 --sweep rules.n_z_max=9 --output OUT.csv": "run.h5",
    "handicap course.yaml --aircraft other.yaml --flight run.h5 --hours hours.csv --output OUT": (
        "course.yaml plane.yaml extension.py other.yaml run.h5 hours.csv"
    ),
    "handicap run.h5 --output OUT": "run.h5",
    f"export {KML} --output OUT": "run.h5 log.csv",
    f"{LOG} --aircraft other.yaml --output OUT": "log.csv course.yaml mapping.yaml other.yaml",
    f"{LOG} --output OUT": "plane.yaml extension.py",
    "fit log.csv --course course.yaml --aircraft other.yaml --mapping mapping.yaml --output OUT": (
        "log.csv course.yaml mapping.yaml other.yaml extension.py"
    ),
    "init OUT.yaml --like course.yaml": "course.yaml",
    "init OUT.yaml --from places.kml": "places.kml",
    "aircraft mine --from plane.yaml --stall 57kt --output OUT": "plane.yaml",
    **{
        f"batch course.yaml {INPUTS} batch.yaml {report} OUT": (
            "course.yaml other.yaml settings.yaml batch.yaml second.yaml extension.py"
        )
        for report in ("--csv", "--junit", "--markdown")
    },
    "batch batch.yaml --csv OUT": "second.yaml plane.yaml",
    "batch course.yaml --until homotopy --output OUT/": "course.yaml plane.yaml",
}
"""Commands, and the files that each of them reads."""
PAIRS = [(command, name) for command, names in COMMANDS.items() for name in names.split()]
WRITES = {"output", "plot", "like"}
"""Parameters that only commands with an output have."""
READ = {"FILE", "TRACK", "OTHER.h5", "FILE.yaml"}
"""What options call the files that they read; those that name reports of a batch are called so, too."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an input of every kind."""
    folder = tmp_path_factory.mktemp("inputs")
    track = (ROOT / "tracks" / "rovinj_2014.yaml").read_text(encoding="utf-8")
    assert "aircraft: edge540\n" in track
    (folder / "course.yaml").write_text(track.replace("edge540", "plane.yaml"), encoding="utf-8")
    for name in ("plane.yaml", "other.yaml"):
        shutil.copy(ROOT / "configs" / "edge540.yaml", folder / name)
    shutil.copy(folder / "course.yaml", folder / "second.yaml")
    (folder / "settings.yaml").write_text("schema: airrace/settings/1\nguess: plan\n")
    (folder / "batch.yaml").write_text("schema: airrace/batch/1\ncourses: [second.yaml]\n")
    shutil.copy(ROOT / "tests" / "flights" / "logs" / "rovinj_2014.csv", folder / "log.csv")
    (folder / "mapping.yaml").write_text("schema: airrace/log/1\n")
    (folder / "hours.csv").write_text("hour,qnh_hPa\nnoon,1013\n")
    (folder / "places.kml").write_text("<kml/>")
    (folder / "extension.py").write_text("")
    with pytest.MonkeyPatch.context() as patch:
        fake_optimizer.install(patch)
        patch.chdir(folder)
        assert CliRunner().invoke(app, ["optimize", "course.yaml", "--quiet", "--output", RUN]).exit_code == 0
    return folder


def outputs(name: str, option: str) -> Iterator[str]:
    """Make every kind of path that leads to a file, as an option wants it to be called; yield them."""
    path = Path(name)
    suffix = option.removeprefix("OUT")
    if suffix == "/":  # a folder in which a job's checkpoint, or its record, has the name of a link
        for kind in ("h5", "json"):
            Path(f"{kind}s").mkdir()
            Path(f"{kind}s/course.{kind}").symlink_to(path.resolve())
            yield f"{kind}s"
        return
    if path.suffix == suffix or not suffix:
        yield name
        yield str(path.resolve())
        yield f"../{Path.cwd().name}/./{name}"
    Path(f"soft{suffix}").symlink_to(name)
    Path(f"hard{suffix}").hardlink_to(name)
    Path(f"far{suffix}").symlink_to(f"soft{suffix}")
    yield from (f"soft{suffix}", f"hard{suffix}", f"far{suffix}")


@pytest.mark.parametrize(
    ("command", "name", "turn"),
    [
        *(pytest.param(*pair, turn, id=f"{': '.join(pair)}") for turn, pair in enumerate(PAIRS)),
        *(pytest.param(*pair, None, id=f"{': '.join(pair)}, every path", marks=pytest.mark.slow) for pair in PAIRS),
    ],
)
def test_a_file_that_is_read_is_not_written(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, name: str, turn: int | None
) -> None:
    """Two kinds of path in turn for each file, which are all of them for each command that reads several."""
    folder = tmp_path / "here"
    shutil.copytree(inputs, folder)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("AIRRACE_EXTENSIONS", "extension.py")
    fake_optimizer.install(monkeypatch)
    monkeypatch.setattr(film, "browser_path", lambda *_: "chromium")  # which is not needed to refuse a file
    content = (folder / name).read_bytes()
    (option,) = (word for word in command.split() if word.startswith("OUT"))
    paths = list(outputs(name, option))
    for output in paths if turn is None else {paths[turn % len(paths)], paths[(turn + 3) % len(paths)]}:
        words = [output if word == option else word for word in command.split()]
        refused = CliRunner().invoke(app, [*words, *(() if words[0] == "batch" else ("--force",))])
        assert (refused.exit_code, refused.stderr.count("is read by this command")) == (2, 1), refused.stderr
        assert (folder / name).read_bytes() == content
    assert not Path("batch").exists() or list(Path("batch").glob("*.h5")) == []


def test_a_file_behind_stdin_is_not_written(tmp_path: Path) -> None:
    course = tmp_path / "course.png"
    shutil.copy(ROOT / "tracks" / "rovinj_2014.yaml", course)
    command = [sys.executable, "-m", "airrace", "check", "-", "--plot", "course.png", "--force"]
    with course.open() as file:
        refused = subprocess.run(command, stdin=file, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (refused.returncode, refused.stderr.count("is read by this command")) == (2, 1)
    assert course.read_text().startswith("#")


def commands(group: Any, before: str = "") -> Iterator[tuple[str, list[Any]]]:  # Any: typer carries its own click
    """Yield the words of every command with its parameters."""
    context = typer.Context(group)
    for name in group.list_commands(context):
        child = group.get_command(context, name)
        if hasattr(child, "list_commands"):
            yield from commands(child, f"{before}{name} ")
        else:
            yield f"{before}{name}", child.params


def test_every_option_that_names_an_input_of_a_command_that_writes_is_tried() -> None:
    writing = {
        words: [
            max(one.opts, key=len)
            for one in parameters
            if one.opts[0].startswith("-") and one.metavar in READ and one.name not in WRITES
        ]
        for words, parameters in commands(typer.main.get_command(app))
        if words.partition(" ")[2] in ("", "csv", "kml")  # which stands for all formats of several flights
        and any(one.name in WRITES for one in parameters)
    }
    assert len(writing) == 19
    for words, options in writing.items():
        tried = " ".join(command for command in COMMANDS if command.startswith(f"{words} "))
        assert tried
        assert [option for option in options if option not in tried.split()] == []
