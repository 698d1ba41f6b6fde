"""Patterns of files: what they mean, and that they end."""

import os
from pathlib import Path

import pytest
from batch_examples import planned, write_course

from airrace.batch import sources
from airrace.batch.sources import TooWideError, matching


def names(found: list[str], folder: Path) -> list[str]:
    return [str(Path(one).relative_to(folder)) for one in found]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name in ("a.yaml", "one/b.yaml", "one/two/c.yaml", "one/two/d.txt", ".hidden/e.yaml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.parametrize(
    ("pattern", "found"),
    [
        ("*.yaml", ["a.yaml"]),
        ("**/*.yaml", ["a.yaml", "one/b.yaml", "one/two/c.yaml"]),
        ("one/**/*.yaml", ["one/b.yaml", "one/two/c.yaml"]),
        ("**/two/*", ["one/two/c.yaml", "one/two/d.txt"]),
        ("**", ["a.yaml", "one/b.yaml", "one/two/c.yaml", "one/two/d.txt"]),
        ("o*/**/*.txt", ["one/two/d.txt"]),
        ("x/**/*.yaml", []),
    ],
)
def test_pattern_means_these_files(pattern: str, found: list[str], tree: Path) -> None:
    assert names(matching(str(tree / pattern)), tree) == found


def test_pattern_may_begin_where_one_is(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tree / "one")
    assert matching("**/*.yaml") == ["b.yaml", "two/c.yaml"]


def test_links_in_a_circle_lead_nowhere(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one/up", "one/two/up"):
        (tree / name).symlink_to(tree)
    monkeypatch.setattr(sources, "FOLDERS_MAX", 3)  # as many as there are
    assert names(matching(str(tree / "**" / "*.yaml")), tree) == ["a.yaml", "one/b.yaml", "one/two/c.yaml"]


def test_pattern_that_is_too_wide_is_refused_in_words(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "FOLDERS_MAX", 2)
    with pytest.raises(TooWideError, match="leads through more than 2 folders"):
        matching(str(tree / "**" / "*.yaml"))
    monkeypatch.setattr(sources, "MATCHES_MAX", 1)
    with pytest.raises(TooWideError, match="matches more than 1 files"):
        matching(str(tree / "one" / "two" / "*"))


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs the files of Linux about its processes")
def test_files_of_the_system_are_no_courses_and_soon_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[object] = []

    def scandir(path: str = ".") -> object:
        read.append(path)
        return scanned(path)

    scanned = os.scandir
    monkeypatch.setattr(os, "scandir", scandir)
    monkeypatch.setattr(sources, "FOLDERS_MAX", 500)
    with pytest.raises(TooWideError):
        matching("/proc/**/*")
    assert len(read) < 3 * sources.FOLDERS_MAX  # twice each: what lies in it, what matches; some vanish meanwhile


def test_batch_that_lists_itself_is_told_so(tmp_path: Path) -> None:
    course = write_course(tmp_path)
    batch = tmp_path / "batch.yaml"
    batch.write_text(f"schema: airrace/batch/1\ncourses: [batch.yaml, {os.path.basename(course)}]\n")
    plan = planned(batch, folder=tmp_path)
    assert [step.name for step in plan.steps] == [course.stem]
    assert [f"{one.line}: {one.message}" for one in plan.findings] == [
        f"2: {batch} is a batch and no course; name the courses that it names"
    ]


def test_sweep_that_makes_half_a_gate_is_blamed_and_not_set(tmp_path: Path) -> None:
    plan = planned(write_course(tmp_path), folder=tmp_path, sweeps=["gates.gx.north_m=1,2"])
    findings = {finding for step in plan.steps if step.known for finding in step.known.findings}
    assert [(one.file, one.key) for one in findings] == [("--sweep", "gates.gx.type")]
