"""Modules and aircraft of installed packages, by entry points."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from airrace.cli.installation import examine
from airrace.errors import UsageError
from airrace.files.inputs.document import AIRCRAFT
from airrace.runs.courses import catalogue
from airrace.runtime.extensions import (
    extension_versions,
    installed_aircraft,
    installed_extensions,
    load_extensions,
)

Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Put a package of one module and its entry points on the path, as an installer leaves it."""

    def put(module: str, text: str, group: str, point: str) -> Path:
        information = tmp_path / "extras-1.2.dist-info"
        information.mkdir()
        (information / "METADATA").write_text("Metadata-Version: 2.1\nName: extras\nVersion: 1.2\n", encoding="utf-8")
        (information / "entry_points.txt").write_text(f"[{group}]\n{point} = {module}\n", encoding="utf-8")
        path = tmp_path / f"{module}.py"
        path.write_text(text, encoding="utf-8")
        return path

    monkeypatch.syspath_prepend(str(tmp_path))
    installed_extensions.cache_clear()
    installed_aircraft.cache_clear()
    yield put
    installed_extensions.cache_clear()
    installed_aircraft.cache_clear()


@pytest.mark.parametrize("group", ["airrace.gates", "airrace.fidelities", "airrace.exports", "airrace.limits"])
def test_module_of_an_entry_point_is_imported_once(install: Install, tmp_path: Path, group: str) -> None:
    log, module = tmp_path / "log", f"noting_{group.rpartition('.')[2]}"
    install(module, f"with open({str(log)!r}, 'a') as log:\n    print('here', file=log)\n", group, "noting")
    load_extensions()
    load_extensions()
    assert log.read_text(encoding="utf-8").split() == ["here"]


def test_version_has_that_of_the_package_and_the_digits_of_the_module(install: Install) -> None:
    path = install("versioned", "A = 1\n", "airrace.limits", "one")
    before = extension_versions()
    assert before["extras:versioned"].startswith("1.2, ")
    path.write_text("A = 2\n", encoding="utf-8")
    assert extension_versions() != before


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = 1\n1 / 0\n", " = failing, which fails in line 2: ZeroDivisionError: division by zero"),
        ("raise SystemExit\n", "it ends the program, which an extension must not do"),
        ("import no_such_module\n", "ModuleNotFoundError: No module named 'no_such_module'"),
    ],
)
def test_module_that_fails_is_named_with_its_package_every_time(install: Install, text: str, words: str) -> None:
    install("failing", text, "airrace.exports", "one")
    for _ in range(2):
        with pytest.raises(UsageError) as refused:
            load_extensions()
        assert str(refused.value).startswith("the package extras has the entry point airrace.exports: one = failing")
        assert words in str(refused.value)


def test_aircraft_of_a_package_is_found_by_its_name_behind_the_shipped_ones(install: Install, tmp_path: Path) -> None:
    install("hangar", "", "airrace.aircraft", "my_extra")
    file = tmp_path / "my_extra.yaml"
    file.write_text("schema: airrace/aircraft/1\n", encoding="utf-8")
    assert AIRCRAFT.file(Path("my_extra")) == file
    assert AIRCRAFT.label(Path("my_extra")) == Path("my_extra")
    assert AIRCRAFT.names[-1] == "my_extra"
    assert AIRCRAFT.file(Path("edge540")).parent == AIRCRAFT.path


def test_aircraft_of_a_package_is_listed_with_the_shipped_ones(install: Install, tmp_path: Path) -> None:
    install("hangar", "", "airrace.aircraft", "my_extra")
    text = AIRCRAFT.named("edge540").read_text(encoding="utf-8")
    (tmp_path / "my_extra.yaml").write_text(text, encoding="utf-8")
    masses = {aircraft.name: aircraft.mass for aircraft in catalogue().aircraft}
    assert masses["my_extra"] == masses["edge540"]
    assert "aircraft my_extra" in next(item.found for item in examine() if item.name == "extensions")


def test_aircraft_without_a_file_is_refused(install: Install) -> None:
    install("empty_hangar", "", "airrace.aircraft", "my_extra")
    with pytest.raises(UsageError, match=r"my_extra = empty_hangar, in whose folder there is no file my_extra\.yaml"):
        installed_aircraft()
