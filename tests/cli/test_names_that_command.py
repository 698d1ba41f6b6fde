"""Names in untrusted files are no commands to a runner of workflows (GitHub Actions), whichever command prints them."""

import re
import subprocess
import sys
from pathlib import Path

import fake_optimizer
import pytest
from command import run

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no file there has a colon in its name")
COURSE = "::error::a.yaml"
RUN = "::error::a.h5"
COMMAND = re.compile(r"^\s*::|##\w*\[", re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a course whose names are commands, one that is not valid, and a run of the former."""
    place = tmp_path_factory.mktemp("hostile")
    text = (ROOT / "tracks" / "rovinj_2014.yaml").read_text(encoding="utf-8")
    text = re.sub(r"(?m)^name: .*$", lambda _: 'name: "::set-output name=a::b\\n::error::##[error]c"', text)
    (place / COURSE).write_text(text, encoding="utf-8")
    (place / "::error::b.yaml").write_text(f"{text}\n'::error::x': 1\n", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        fake_optimizer.install(patch)
        assert run("optimize", COURSE, "--quiet").code == 0
    return place


@pytest.mark.parametrize(
    "words",
    [
        ("check", COURSE),
        ("check", COURSE, "--json"),
        ("show", RUN),
        ("show", RUN, "--legs"),
        ("show", RUN, "--json"),
        ("brief", RUN),
        ("brief", RUN, "--csv"),
        ("compare", RUN, RUN),
        ("export", "csv", RUN),
        ("export", "csv", RUN, "--splits"),
        ("optimize", COURSE, "--force", "--json"),
        ("resume", RUN, "--dry-run"),
        ("batch", COURSE, "--dry-run"),
    ],
    ids=" ".join,
)
def test_no_printed_line_is_a_command(folder: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]) -> None:
    monkeypatch.chdir(folder)
    fake_optimizer.install(monkeypatch)
    ran = run(*words)
    assert (ran.code, COMMAND.findall(ran.out)) == (0, [])
    assert ran.out


@pytest.mark.parametrize(
    ("words", "code"),
    [(("check", "::error::b.yaml"), 3), (("check", "a\n::error::c.yaml"), 3), (("optimize", COURSE), 2)],
)
def test_no_line_on_stderr_is_a_command(folder: Path, words: tuple[str, ...], code: int) -> None:
    command = [sys.executable, "-m", "airrace", *words]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
    assert ran.returncode == code, ran.stderr
    assert "error" in ran.stderr
    assert COMMAND.findall(ran.stdout + ran.stderr) == []
