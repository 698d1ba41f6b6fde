"""The survey tells of every run how it ended, and goes on."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HALF_CUBAN = ROOT / "tracks" / "half_cuban_eight.yaml"


def survey(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "scripts" / "survey_courses.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_every_run_has_a_line_and_a_bad_file_does_not_end_the_survey(tmp_path: Path) -> None:
    bad, log = tmp_path / "bad.yaml", tmp_path / "survey.log"
    bad.write_text("schema: airrace/track/1\nname: nothing\n", encoding="utf-8")
    ran = survey(bad, HALF_CUBAN, "--guess", "plan", "--set", "settings.search=off", "--log", log)
    assert ran.returncode == 0, ran.stderr
    headings, refused, flown, *summary = ran.stdout.splitlines()
    assert headings.split()[:2] == ["course", "aircraft"]
    assert refused.split()[:6] == ["bad", "-", "-", "plan", "invalid", "input"]
    assert flown.split()[:6] == ["half_cuban_eight", "edge540", "5", "plan", "certified", "8.634"]
    assert [line.split(",")[0] for line in summary] == ["plan: certified 1 of 2"]
    assert summary[0].endswith("; 1 invalid input")
    assert log.read_text(encoding="utf-8") == ran.stdout


@pytest.mark.slow
def test_both_guesses_are_counted_for_themselves_and_together() -> None:
    ran = survey(HALF_CUBAN, "--set", "settings.search=off")
    assert [line.split(",")[0] for line in ran.stdout.splitlines()[3:]] == [
        "plan: certified 1 of 1",
        "homotopy: certified 1 of 1",
        "either guess: certified 1 of 1 courses",
    ]


def test_a_run_that_takes_too_long_is_stopped() -> None:
    ran = survey("--seeds", "0", "--guess", "homotopy", "--timeout", "0.5")
    assert "out of time" in ran.stdout.splitlines()[1]
    assert ran.stdout.splitlines()[1].startswith("seed_0 ")


@pytest.mark.parametrize(
    "arguments", [("--seeds", "9-3"), *(pytest.param(one, marks=pytest.mark.slow) for one in ((), ("--seeds", "x")))]
)
def test_what_cannot_be_surveyed_is_refused(arguments: tuple[str, ...]) -> None:
    ran = survey(*arguments)
    assert (ran.returncode, ran.stdout) == (2, "")
