"""A closed terminal, a reader that has gone and a full disk behind a stream: nothing hangs, and the code says why."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from airrace_command import ALONG_THE_PLAN, HALF_CUBAN, Ran, inside

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="redirects streams with a shell of Unix")
QUICKLY = f"optimize {HALF_CUBAN} {' '.join(ALONG_THE_PLAN)}"


def shell(line: str, cwd: Path, **environment: str) -> Ran:
    """Run a line of the shell, in which `airrace` is the command."""
    command = f'airrace() {{ "{sys.executable}" -m airrace "$@"; }}; {line}'
    ran = subprocess.run(
        ["bash", "-c", command],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        timeout=240.0,
        env={**os.environ, **environment},
    )
    assert "Traceback" not in ran.stderr, ran.stderr
    assert "this is a bug" not in ran.stderr, ran.stderr
    return Ran(ran.returncode, ran.stdout, ran.stderr)


def test_a_reader_of_the_progress_that_goes_away_does_not_end_the_run(tmp_path: Path) -> None:
    line = f"airrace {QUICKLY} --output x.h5 2>&1 >/dev/null | head -3; exit ${{PIPESTATUS[0]}}"
    ran = shell(line, tmp_path)
    assert ran.code == 0
    assert len(ran.out.splitlines()) == 3
    assert inside("show", "x.h5", "--json", cwd=tmp_path).answer["certified"] is True


@pytest.mark.parametrize(
    "line",
    [
        "tracks >&-",
        "tracks --json >/dev/full",
        "--help >&-",
        "--version >/dev/full",
    ],
)
def test_stdout_that_cannot_be_written_ends_with_its_own_code(line: str, tmp_path: Path) -> None:
    ran = shell(f"airrace {line}", tmp_path)
    assert ran.code == 8
    assert ran.err.startswith("airrace: cannot write to stdout: ")
    assert ran.err.count("\n") == 1


def test_a_reader_that_leaves_early_gets_no_error(tmp_path: Path) -> None:
    assert shell("{ sleep 1; airrace --help; } | true; exit ${PIPESTATUS[0]}", tmp_path) == Ran(0, "", "")


def test_stderr_that_cannot_be_written_changes_neither_answer_nor_code(tmp_path: Path) -> None:
    assert shell("airrace tracks 2>&-", tmp_path) == shell("airrace tracks", tmp_path)
    for redirection in ("2>&-", "2>/dev/full", "<&- 2>&-"):
        refused = shell(f"airrace optimize nothing --json {redirection}", tmp_path)
        assert refused.code == 3
        assert refused.answer["findings"]


def test_a_checkpoint_is_whole_although_all_streams_are_closed(tmp_path: Path) -> None:
    """Its file would get the number of a closed stream, and what is printed would get into it."""
    assert shell(f"airrace {QUICKLY} --output x.h5 <&- >&- 2>&-", tmp_path).code == 8
    assert inside("show", "x.h5", "--json", cwd=tmp_path).answer["certified"] is True


def test_a_reader_of_a_long_table_may_leave_early_and_a_full_disk_is_an_error(tmp_path: Path) -> None:
    assert inside(*QUICKLY.split(), "--output", "x.h5", cwd=tmp_path).code == 0
    ran = shell("airrace export csv x.h5 --rate 2000 | head -2; exit ${PIPESTATUS[0]}", tmp_path)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("# track: Half Cuban Eight\n")
    ran = shell("airrace export csv x.h5 --rate 2000 >/dev/full", tmp_path)
    assert ran.code == 8
    assert "No space left on device" in ran.err
