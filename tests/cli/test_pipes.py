"""`-` is stdin and stdout, `--json` tells what was written, and every option has a variable."""

import csv
import io
import json
from pathlib import Path

import fake_optimizer
import pytest
import typer.main
from typer.testing import CliRunner, Result

from airrace.cli.main import app

ROOT = Path(__file__).parents[2]
TRACK = (ROOT / "tracks" / "rovinj_2014.yaml").read_text(encoding="utf-8")
LOG = ROOT / "tests" / "flights" / "logs" / "rovinj_2014.csv"
MARK = "<Placemark><name>{0}</name><Point><coordinates>13.6{0},45.1</coordinates></Point></Placemark>"
KML = f"<kml>{''.join(MARK.format(number) for number in range(4))}</kml>"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run."""
    folder = tmp_path_factory.mktemp("pipes")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        fake_optimizer.install(patch)
        assert airrace("optimize", "-", "-q", "-o", "run.h5", piped=TRACK).exit_code == 0
        assert airrace("import", str(LOG), "--course", "rovinj_2014", "-q", "-o", "flown.h5").exit_code == 0
    return folder


@pytest.fixture(autouse=True)
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_optimizer.install(monkeypatch)
    monkeypatch.chdir(folder)


def airrace(*words: str, piped: str | bytes = "", **environment: str) -> Result:
    return CliRunner().invoke(app, words, input=piped, env=environment)


def test_a_course_is_read_from_stdin_and_called_so() -> None:
    checked = airrace("check", "-", "--json", piped=TRACK)
    assert (checked.exit_code, json.loads(checked.stdout)["track"]) == (0, "stdin")
    assert json.loads(airrace("show", "run.h5", "--json").stdout)["track"] == "stdin"
    refused = airrace("check", "-", piped=TRACK.replace("aircraft:", "airplane:"))
    assert refused.exit_code == 3
    assert refused.stderr.startswith("stdin:")


@pytest.mark.parametrize("option", ["--settings", "--aircraft"])
def test_another_input_is_read_from_stdin(option: str) -> None:
    refused = airrace("check", "half_cuban_eight", option, "-", piped="schema: airrace/log/1\n")
    assert (refused.exit_code, "stdin:1" in refused.stderr) == (3, True)


def test_a_plan_of_a_new_run_writes_nothing() -> None:
    planned = airrace("optimize", "-", "-n", "--until", "point-mass", piped=TRACK)
    assert planned.stdout == "homotopy: run (it is not finished)\npoint-mass: run (it is not finished)\n"
    assert not Path("stdin.h5").exists()


@pytest.mark.parametrize("words", [("show",), ("export", "csv"), ("verify",), ("export", "mat", "-o", "-")])
def test_a_run_that_is_piped_in_is_read_like_its_file(words: tuple[str, ...]) -> None:
    command, *options = words if words[0] != "export" else (" ".join(words[:2]), *words[2:])
    piped, named = (
        airrace(*command.split(), name, *options, piped=Path("run.h5").read_bytes()) for name in ("-", "run.h5")
    )
    assert named.exit_code == 0
    assert (piped.exit_code, piped.stderr) == (named.exit_code, named.stderr.replace("run.h5", "stdin"))
    if words[-1] != "-":
        assert piped.stdout == named.stdout.partition("\nnext: ")[0]  # what is piped in has no name to go on with


def test_one_table_goes_to_stdout() -> None:
    flight = airrace("export", "csv", "run.h5", "--output", "-")
    assert flight.stdout == airrace("export", "csv", "run.h5").stdout
    rows = list(csv.reader(line for line in io.StringIO(flight.stdout) if not line.startswith("#")))
    assert {len(row) for row in rows} == {len(rows[0])}
    assert sorted(path.name for path in Path().iterdir()) == ["flown.h5", "run.h5"]


@pytest.mark.parametrize(
    ("words", "begins"),
    [
        ("export kml flown.h5 -o -", b"<?xml"),
        ("export kmz flown.h5 -o -", b"PK"),
        ("report flown.h5 -o -", b"<!doctype html>"),
        ("report -", b"<!doctype html>"),
        ("plot flown.h5 -o -", b"\x89PNG"),
        ("compare flown.h5 flown.h5 --plot -", b"\x89PNG"),
        ("check rovinj_2014 --plot -", b"\x89PNG"),
        (f"import {LOG} --course rovinj_2014 -o -", b"\x8bairrace"),
        ("init -", b"# A "),
        ("init - --from -", b"# Sketched from stdin."),
    ],
)
def test_a_file_goes_to_stdout_alone(words: str, begins: bytes) -> None:
    piped = KML if "--from" in words else Path("flown.h5").read_bytes()
    ran = airrace(*words.split(), piped=piped)
    assert (ran.exit_code, ran.stderr) == (0, "")
    assert ran.stdout_bytes.lower().startswith(begins.lower())
    assert sorted(path.name for path in Path().iterdir()) == ["flown.h5", "run.h5"]
    if not words.startswith(("init", "report -")):
        refused = airrace(*words.split(), "--json", piped=piped)
        assert (refused.exit_code, "only one result can go to stdout" in refused.stderr) == (2, True)


@pytest.mark.parametrize(
    "words",
    [
        "optimize half_cuban_eight -o -",
        "resume run.h5 --set rules.n_z_max=9 -o -",
        "resume - --until point-mass",
    ],
)
def test_a_checkpoint_that_is_renewed_needs_a_file(words: str) -> None:
    refused = airrace(*words.split(), piped=Path("run.h5").read_bytes())
    assert (refused.exit_code, "name one with --output" in refused.stderr) == (2, True)


def test_a_course_of_a_batch_has_a_name() -> None:
    refused = airrace("batch", "-", piped=TRACK)
    assert (refused.exit_code, "stdin: is no batch file" in refused.stderr) == (3, True)
    batch = "schema: airrace/batch/1\ncourses: [half_cuban_eight]\n"
    assert airrace("batch", "-", "-n", piped=batch).stdout.startswith("half_cuban_eight: fly")


@pytest.mark.parametrize(
    ("words", "files"),
    [
        ("export csv flown.h5 -o lap.csv", ["lap.csv", "lap.splits.csv"]),
        ("export kml flown.h5", ["flown.kml"]),
        ("report flown.h5", ["flown.html"]),
        ("plot flown.h5", ["flown.png"]),
        ("init new", ["new.yaml"]),
        (f"import {LOG} --course rovinj_2014 -o again.h5", ["again.h5"]),
    ],
)
def test_what_was_written_is_reported(words: str, files: list[str]) -> None:
    told = json.loads(airrace(*words.split(), "--json").stdout)
    assert told["written"] == [{"path": name, "bytes": Path(name).stat().st_size} for name in files]
    if "flown.h5" in words:
        assert told["flights"] == ["flown.h5"]
        assert told["format"] in words + files[0]
    said = airrace(*words.split(), "--force").stdout
    assert [name for name in files if f"{name} is written" not in said] == []
    assert airrace(*words.split(), "-f", "-q").stdout == ""
    for name in files:
        Path(name).unlink()


def test_verbose_tells_what_is_read_and_written() -> None:
    ran = airrace("report", "flown.h5", "-o", "page.html", "-v")
    Path("page.html").unlink()
    assert ran.stderr.splitlines()[0] == "airrace: info: flown.h5 is read"
    assert ran.stderr.splitlines()[-1].startswith("airrace: info: page.html is written, ")
    assert airrace("show", "flown.h5").stderr == ""


def test_an_option_is_read_from_its_variable() -> None:
    assert json.loads(airrace("show", "run.h5", AIRRACE_SHOW_JSON="1").stdout)["track"] == "stdin"
    table = airrace("export", "csv", "run.h5", "--splits").stdout
    assert airrace("export", "csv", "run.h5", AIRRACE_EXPORT_CSV_SPLITS="true").stdout == table
    told = airrace("check", "half_cuban_eight", AIRRACE_CHECK_SET="nonsense=1 rules.n_z_max=9")
    assert "--set: nonsense" in told.stderr
    assert "point-mass" not in airrace("show", "run.h5", "--stage", "homotopy", AIRRACE_SHOW_STAGE="point-mass").stdout


def test_variables_of_other_use_are_no_options() -> None:
    used = {"AIRRACE_DEBUG", "AIRRACE_EXTENSIONS", "AIRRACE_CACHE_DIR", "AIRRACE_TESTS_CACHE", "AIRRACE_ARTEFACTS"}
    root = typer.main.get_command(app)
    assert not {word for variable in used for word in variable.lower().split("_")} & set(getattr(root, "commands", {}))
    assert airrace("tracks", AIRRACE_VERSION="1").stdout.startswith("courses")


@pytest.mark.parametrize("other", ["../{}/a.png", "link.png"])
def test_two_drawings_are_not_written_into_one_file(tmp_path: Path, other: str) -> None:
    drawing = tmp_path / "a.png"
    (tmp_path / "link.png").symlink_to(drawing)
    again = str(tmp_path / other.format(tmp_path.name))
    refused = airrace("compare", "flown.h5", "flown.h5", "--plot", str(drawing), "--map", again)
    assert (refused.exit_code, "is another file that this command writes" in refused.stderr) == (2, True)
    assert not drawing.exists()
