"""What `show`, `report` and `compare` tell of a run was measured again, or they say that it was not."""

import contextlib
import json
import re
from pathlib import Path

import pytest
from tampered_checkpoints import FOUND, POINT_MASS, TRANSFER, genuine, versions
from typer.testing import CliRunner, Result

import airrace
from airrace.cli.main import app
from airrace.errors import SolverCrash
from airrace.files.checkpoint import Checkpoint, write_checkpoint
from airrace.procedure import procedure
from airrace.procedure.result import Status

pytestmark = pytest.mark.usefixtures("measured_once")

OBJECTIONS = {
    "race time": "it does not hold: ",
    "a control": "it does not hold: ",
    "times of splits": "gate split 1:vertical, time: ",
    "first stage dropped": "missing: homotopy",
    "multipliers of another problem": "1 multipliers are stored",
}
"""Tampered runs, and what the commands that show them say."""


def written(checkpoint: Checkpoint, folder: Path) -> Path:
    write_checkpoint(folder / "run.h5", checkpoint)
    return folder / "run.h5"


def ran(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(one) for one in arguments])


def commands(path: Path) -> dict[str, list[str | Path]]:
    return {
        "show": ["show", path],
        "report": ["report", path, "--force"],
        "compare": ["compare", path, f"{path}:transfer-function"],
    }


def badge(path: Path) -> tuple[str, str]:
    """The kind of the badge of a report, and its words."""
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    found = re.search(r'<a class="verdict (\w+)" [^>]*>([^<]*)</a>', page)
    assert found is not None
    return found[1], found[2]


def test_a_genuine_run_is_verified(tmp_path: Path) -> None:
    path = written(genuine(), tmp_path)
    for name, command in commands(path).items():
        result = ran(*command)
        assert (result.exit_code, "verified" in result.stdout, "not verified" in result.stdout) == (0, True, False), (
            name
        )
        answer = json.loads(ran(*command, "--json").stdout)
        one = answer.get("reference", answer)
        assert one["verified"] in (True, [True]), name
    assert badge(path) == ("good", "certified")
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    (claim,) = re.findall(r'<section class="panel" id="claim">.*?</section>', page, re.DOTALL)
    assert "<p>Certified: a local " in claim
    assert "<p>Verified.</p>" in claim


@pytest.mark.parametrize(("name", "words"), OBJECTIONS.items(), ids=OBJECTIONS)
def test_a_tampered_run_fails_verification_in_all_commands_that_show_it(name: str, words: str, tmp_path: Path) -> None:
    path = written(FOUND[name](genuine()), tmp_path)
    for command in commands(path).values():
        result = ran(*command)
        assert result.exit_code == 5, result.output
        assert "verification failed" in " ".join(result.stdout.split())
        assert re.search(words, result.stderr)
        answer = json.loads(ran(*command, "--json").stdout)
        assert "verification failed: " in json.dumps(answer)
        assert '"certified": true' not in json.dumps(answer.get("stages", [answer])[-1])
    assert badge(path) == ("bad", "not certified; verification failed")


def test_a_stage_is_measured_where_it_is_shown(tmp_path: Path) -> None:
    """A tampered stage below leaves the flight of the last one as it was."""
    path = written(FOUND["race time of the stage below"](genuine()), tmp_path)
    assert ran("show", path).exit_code == 5
    assert ran("show", path, "--stage", POINT_MASS.value).exit_code == 5
    assert ran("show", path, "--stage", TRANSFER.value).exit_code == 0
    assert ran("report", path, "--force").exit_code == 0
    assert ran("report", path, "--force", "--stage", POINT_MASS.value).exit_code == 5
    compared = json.loads(ran("compare", f"{path}:transfer-function", f"{path}:point-mass", "--json").stdout)
    assert (compared["reference"]["verified"], compared["flights"][0]["verified"]) == (True, False)
    assert compared["flights"][0]["status"] == Status.NOT_CERTIFIED.value


def test_nothing_is_measured_without_verification_and_all_say_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(FOUND["race time"](genuine()), tmp_path)
    monkeypatch.delattr(procedure, "recompute")
    for command in commands(path).values():
        result = ran(*command, "--no-verify")
        assert result.exit_code == 0, result.output
        assert "not verified" in " ".join(result.stdout.split())
        answer = json.loads(ran(*command, "--no-verify", "--json").stdout)
        one = answer.get("reference", answer)
        assert one["verified"] in (None, [None])
        assert one.get("verification", one.get("stages", [{}])[-1].get("verification")) in (
            "not verified",
            ["not verified"],
        )
    assert badge(path) == ("unsure", "certified; not verified")


def test_runs_that_cannot_be_measured_are_shown_as_not_verified(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(versions(numpy="1.26.0")(genuine()), tmp_path)
    for command in commands(path).values():
        result = ran(*command)
        assert result.exit_code == 0, result.output
        assert "not verified: it is said to be made with numpy 1.26.0" in " ".join(result.stdout.split())
    assert badge(path)[0] == "unsure"

    def dies(*_: object) -> None:
        raise SolverCrash("the solver process died")

    path = written(genuine(), tmp_path)
    monkeypatch.setattr(procedure, "recompute", dies)
    result = ran("show", path)
    assert (result.exit_code, "not verified: the solver process died" in result.stdout) == (0, True)


def test_a_stage_that_claims_nothing_is_not_accused(tmp_path: Path) -> None:
    """It says already that it is not certified, and so does a run without any flight."""
    path = written(FOUND["a failure below"](genuine()), tmp_path)
    result = ran("show", path)
    assert result.exit_code == 0, result.output
    assert "point-mass: not verified: it is not certified" in result.stdout


def test_reports_of_python_are_verified_unless_told_otherwise(tmp_path: Path) -> None:
    path = written(FOUND["times of splits"](genuine()), tmp_path)
    run = airrace.open(path)
    run.report(path.with_suffix(".html"))
    assert badge(path) == ("bad", "not certified; verification failed")
    run.report(path.with_suffix(".html"), verify=False)
    assert badge(path)[1].endswith("; not verified")
    with contextlib.chdir(tmp_path):
        airrace.open(written(genuine(), tmp_path)).report("run.html", "run.h5:point-mass")
        assert badge(path)[1] == "certified"
    assert run.certified  # a run itself stays as it was read
