"""How commands end: always with one object or a sentence, never with a traceback."""

import json
import logging

import pytest
import typer

from airrace.cli.answer import answering
from airrace.errors import CheckpointError, Finding, InputError, StorageError
from airrace.runs.command_result import CommandResult, ExitCode


def test_success_prints_the_object_alone(capsys: pytest.CaptureFixture[str]) -> None:
    with answering(as_json=True) as answer:
        answer.fields["track"] = "t"
    printed = capsys.readouterr()
    assert json.loads(printed.out) == {"track": "t"}
    assert printed.err == ""


def test_findings_reach_both_people_and_scripts(capsys: pytest.CaptureFixture[str]) -> None:
    finding = Finding("t.yaml", 3, 5, "gates.g1.heading_deg", "missing")
    with pytest.raises(typer.Exit) as left, answering({"track": "t"}, as_json=True):
        raise InputError([finding])
    printed = capsys.readouterr()
    assert left.value.exit_code == 3
    answered = json.loads(printed.out)
    assert answered["track"] == "t"
    assert answered["findings"] == [
        {"file": "t.yaml", "line": 3, "column": 5, "key": "gates.g1.heading_deg", "message": "missing"}
    ]
    assert "t.yaml:3:5: gates.g1.heading_deg: missing" in printed.err


@pytest.mark.parametrize("number", [20, 21, 7380])
def test_of_many_findings_the_first_are_printed_and_all_are_counted(
    number: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit), answering(as_json=True):
        raise InputError([Finding("t.yaml", line, 1, "", "unknown") for line in range(1, number + 1)])
    printed = capsys.readouterr()
    assert len(json.loads(printed.out)["findings"]) == number
    lines = printed.err.splitlines()
    assert lines[:20] == [f"t.yaml:{line}:1: unknown" for line in range(1, 21)]
    more = ["... (the first 20 are shown; --json has more)"] if number > 20 else []
    assert lines[20:] == [*more, f"airrace: the input is not valid: {number} findings"]


def test_a_finding_cannot_pass_for_another_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit), answering(as_json=False):
        raise InputError([Finding("t.yaml\nairrace: all is well\x1b[2J", 1, 1, "", "unknown")])
    assert capsys.readouterr().err == (
        "t.yaml\u240aairrace: all is well\u241b[2J:1:1: unknown\nairrace: the input is not valid: 1 finding\n"
    )


def test_without_json_nothing_but_data_is_on_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit), answering(as_json=False):
        raise CheckpointError("run.h5: truncated")
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err == "airrace: run.h5: truncated\n"


def test_a_bug_is_one_line_unless_debugging(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for debug in ("", "0"):
        monkeypatch.setenv("AIRRACE_DEBUG", debug)
        with pytest.raises(typer.Exit) as left, answering(as_json=False):
            raise ValueError("two\nlines")
        printed = capsys.readouterr().err
        assert left.value.exit_code == 1
        assert printed.count("\n") == 1
        assert "this is a bug: ValueError: two lines" in printed
    monkeypatch.setenv("AIRRACE_DEBUG", "1")
    with pytest.raises(typer.Exit), answering(as_json=False):
        raise ValueError("two\nlines")
    assert "Traceback" in capsys.readouterr().err


def test_the_graver_failure_speaks() -> None:
    for codes in ((ExitCode.NOT_CERTIFIED, ExitCode.SYSTEM), (ExitCode.SYSTEM, ExitCode.NOT_CERTIFIED)):
        answer = CommandResult()
        for code in codes:
            answer.fail(code, code.name)
        assert (answer.code, answer.error) == (ExitCode.SYSTEM, "SYSTEM")


def test_an_error_outranks_what_a_stage_came_to() -> None:
    def fail_twice() -> None:
        with answering(as_json=False) as answer:
            answer.fail(ExitCode.NOT_CERTIFIED, "not certified")
            raise StorageError("disk full")

    with pytest.raises(typer.Exit) as left:
        fail_twice()
    assert left.value.exit_code == 8


def test_what_the_library_logs_looks_like_every_other_line(capsys: pytest.CaptureFixture[str]) -> None:
    with answering(as_json=False):
        logging.getLogger("airrace.somewhere").warning("no compiled kernels: %s", "no compiler")
        logging.getLogger("airrace.somewhere").info("not worth a word")
    assert capsys.readouterr().err == "airrace: warning: no compiled kernels: no compiler\n"
