"""Files of one's own that the environment names."""

import os
from pathlib import Path

import pytest

from airrace.errors import UsageError
from airrace.runtime.extensions import VARIABLE, extension_versions, extensions, load_extensions


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def counting(path: Path, log: Path) -> Path:
    """A file that notes each time that it runs, and asks for extensions itself."""
    return written(
        path,
        "from airrace.runtime.extensions import load_extensions\n"
        f"with open({str(log)!r}, 'a') as log:\n    print({path.name!r}, file=log)\n"
        "load_extensions()\n",
    )


def test_every_extension_runs_once_in_the_order_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log"
    paths = [counting(tmp_path / name, log) for name in ("b.py", "a.py")]
    monkeypatch.setenv(VARIABLE, os.pathsep.join(map(str, paths)))
    load_extensions()
    load_extensions()
    assert extensions() == paths
    assert log.read_text().split() == ["b.py", "a.py"]


def test_without_the_variable_there_are_no_extensions(monkeypatch: pytest.MonkeyPatch) -> None:
    for text in (None, ""):
        monkeypatch.delenv(VARIABLE, raising=False) if text is None else monkeypatch.setenv(VARIABLE, text)
        assert extensions() == []
        assert extension_versions() == {}
        load_extensions()


def test_version_of_an_extension_changes_with_its_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "one.py", "A = 1\n")
    monkeypatch.setenv(VARIABLE, str(path))
    before = extension_versions()
    assert list(before) == ["one.py"]
    assert extension_versions() == before
    written(path, "A = 2\n")
    assert extension_versions() != before


@pytest.mark.parametrize("name", ["missing.py", "folder", "notes.txt"])
def test_what_is_no_python_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    (tmp_path / "folder").mkdir()
    written(tmp_path / "notes.txt", "A = 1\n")
    monkeypatch.setenv(VARIABLE, str(tmp_path / name))
    for _ in range(2):  # also when asked again
        with pytest.raises(UsageError, match=f"names .*{name}, which is not a Python file"):
            load_extensions()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 / 0", "in line 2: ZeroDivisionError: division by zero"),
        ("raise SystemExit", r"in line 2: it ends the program, which an extension must not do"),
        ("import sys; sys.exit(0)", r"in line 2: it ends the program"),
        ("def leave():\n    exit(3)\nleave()", r"in line 3: it ends the program"),
        ("raise GeneratorExit('nobody foresees this')", "in line 2: GeneratorExit: nobody foresees this"),
        ("a = (", "in line 2: SyntaxError: '\\(' was never closed"),
        ("import json; json.loads('{')", "in line 2: JSONDecodeError"),
    ],
)
def test_extension_that_fails_or_ends_the_program_is_named_with_its_line_every_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, words: str
) -> None:
    monkeypatch.setenv(VARIABLE, str(written(tmp_path / "ending.py", f"# an extension\n{text}\n")))
    for _ in range(2):
        with pytest.raises(UsageError, match=rf"ending\.py, which fails {words}"):
            load_extensions()


def test_an_interrupt_while_an_extension_runs_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(written(tmp_path / "stopped.py", "raise KeyboardInterrupt\n")))
    with pytest.raises(KeyboardInterrupt):
        load_extensions()
