"""Tables for people: no number is cut short, none has a sign it does not deserve."""

import json
import logging
import re
import sys
from dataclasses import asdict, replace

import numpy as np
import pytest
import typer
from fake_optimizer import solve_roughly, solve_single_mesh, stage_result

from airrace.cli.course_tables import course_tables
from airrace.cli.flight_tables import sensitivities_text
from airrace.cli.printed_result import printed_result, render
from airrace.cli.run_tables import items_table, mesh_table
from airrace.errors import CheckpointError, Finding, InputError, StorageError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.document import TRACKS
from airrace.flights.sensitivity import Activity, Sensitivity
from airrace.model.parameters import ParameterGroup
from airrace.optimal_control.certificate import Certificate, Item, RefinementReason
from airrace.pages.views.stage_tables import splits_table, stages_table
from airrace.pages.views.tables import ROWS_SHOWN, Column, Table
from airrace.procedure.result import MeshRecord, StageProvenance, Status
from airrace.procedure.stage import STAGES, Stage
from airrace.runs.command_result import CommandResult, ExitCode

STYLE = re.compile(r"\x1b\[[0-9;]*m")


def terminal(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)


@pytest.mark.parametrize("columns", [20, 80, 200])
def test_no_terminal_is_too_narrow_for_a_number(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal(columns, monkeypatch)
    result = stage_result(Stage.POINT_MASS)
    certificate = result.certificate
    assert certificate is not None
    for table in (stages_table([result]), splits_table(result.splits), items_table(certificate)):
        shown = STYLE.sub("", render(table))
        assert "\u2026" not in shown
        assert columns != 80 or max(map(len, shown.splitlines())) <= 80


def test_where_a_terminal_is_too_narrow_columns_are_left_out_in_their_order_and_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    columns = (Column("gate"), Column("speed", "m/s", ".3f", rank=2), Column("time", "s", ".3f"), Column("x", rank=1))
    table = Table("", columns, [("a gate with a long name", 123.456, 55.868, "x" * 12)])

    def shown(width: int) -> str:
        terminal(width, monkeypatch)
        return STYLE.sub("", render(table))

    assert "too narrow" not in shown(60)
    assert "123.456" in shown(44)
    assert "too narrow for: x\n" in shown(44) + "\n"
    narrow = shown(33)
    assert "123.456" not in narrow
    assert " ".join(narrow.split()).endswith("too narrow for: x, speed m/s")
    narrowest = shown(16)  # nothing else can be left out, so that words are broken
    assert {"long", "55.868"} <= set(narrowest.split())
    assert max(map(len, narrowest.splitlines())) <= 16
    monkeypatch.setattr(sys.stdout, "isatty", lambda: False)
    assert "123.456" in render(table, columns=16)  # who reads a file has no terminal


def test_angles_are_shown_in_degrees_and_a_failed_item_in_capitals() -> None:
    unviolated = Item("roll", 0.0, 0.02, "", "phase 2")  # has no worst place
    items = (unviolated, Item("rate", 0.01, 0.02, "rad/s"), Item("bank", 0.02, 0.01, "rad", "phase 3"))
    roll, rate, bank = render(items_table(Certificate("solved", items))).splitlines()[-3:]
    assert roll.split() == ["roll", "0", "0.02", "yes"]
    assert rate.split() == ["rate", "0.573", "1.15", "deg/s", "yes"]
    assert bank.split() == ["bank", "1.15", "0.573", "deg", "NO", "phase", "3"]


def assert_fits(table: Table, words: set[str]) -> None:
    """The table fits eighty columns, and breaks none of its words."""
    lines = STYLE.sub("", render(table)).splitlines()
    assert max(map(len, lines)) <= 80
    shown = set(" ".join(lines).split())
    assert words - shown == set()


def words_of(table: Table) -> set[str]:
    """All words of a table's head and cells."""
    return {word for row in table.texts() for cell in row for word in cell.split()}


def test_a_table_of_all_stages_fits_eighty_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal(80, monkeypatch)
    flown = replace(stage_result(Stage.POINT_MASS), provenance=StageProvenance(0.012, "point-mass", "", 123.45))
    all_stages = [replace(flown, stage=stage) for stage in STAGES]
    failed = replace(stage_result(Stage.SIX_DOF, Status.NOT_CONVERGED), provenance=flown.provenance)
    solved = [*map(solve_single_mesh, all_stages[:-1]), all_stages[-1]]
    for results in (
        all_stages,
        solved,
        [*all_stages[:-1], failed],
        [replace(one, certificate=None) for one in all_stages],
    ):
        table = stages_table(results)
        assert_fits(table, words_of(table))


def test_the_table_says_which_stages_were_solved_on_one_mesh() -> None:
    below, last = solve_single_mesh(stage_result(Stage.POINT_MASS)), stage_result(Stage.TRANSFER_FUNCTION)
    shown = render(stages_table([below, last]))
    rows = [line.split() for line in shown.splitlines()]
    assert [row[:2] for row in rows if row[:1] in (["point-mass"], ["transfer-function"])] == [
        ["point-mass", "solved"],
        ["transfer-function", "certified"],
    ]
    assert "solved: on one mesh; no second mesh has confirmed the race time" in shown
    assert "as closely as the next stage needs" not in shown
    above = solve_roughly(stage_result(Stage.TRANSFER_FUNCTION))
    assert "transfer-function: as closely as the next stage needs" in render(stages_table([below, above]))
    assert "one mesh" not in render(stages_table([stage_result(Stage.POINT_MASS), last]))
    assert below.certificate is not None
    assert "certified" not in render(items_table(below.certificate))


def test_the_mesh_of_a_stage_fits_eighty_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal(80, monkeypatch)
    result = stage_result(Stage.POINT_MASS)
    why = np.array(
        [RefinementReason.HAMILTONIAN, RefinementReason.RACE_TIME, RefinementReason.CALM, RefinementReason.LIMITS],
        np.int8,
    )
    record = MeshRecord(why, np.ones(5, np.bool_), np.full(4, 1.234e-7), np.full(4, 5.678e-3))
    table = mesh_table(replace(result, mesh=record))
    assert_fits(table, words_of(table))


@pytest.mark.parametrize("name", TRACKS.names)
def test_every_shipped_course_is_shown_in_eighty_columns(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal(80, monkeypatch)
    for table in course_tables(load_inputs(name).race):
        assert_fits(table, words_of(table))


def test_long_keys_take_two_lines_where_the_terminal_is_narrow() -> None:
    key = "aircraft.point_mass.roll_acceleration_max_rad_s2"
    one = Sensitivity(key, ParameterGroup.AIRCRAFT, "rad/s2", 40.0, -1.5e-3, -1.5e-3, 0.4, Activity.BOTH)
    narrow = sensitivities_text(stage_result(Stage.POINT_MASS), [one], 80)
    assert max(map(len, narrow.splitlines())) <= 80
    assert "aircraft.point_mass.\n  roll_acceleration_max_rad_s2" in re.sub(
        r" +\n", "\n", re.sub(r"(\.) .*", r"\1", narrow)
    )
    assert key in sensitivities_text(stage_result(Stage.POINT_MASS), [one])


def test_success_prints_the_object_alone_and_data_alone_is_on_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    with printed_result(as_json=True) as answer:
        answer.fields["track"] = "t"
    printed = capsys.readouterr()
    assert json.loads(printed.out) == {"track": "t"}
    assert printed.err == ""
    with pytest.raises(typer.Exit), printed_result(as_json=False):
        raise CheckpointError("run.h5: truncated")
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "airrace: run.h5: truncated\n")
    with printed_result(as_json=False):
        logging.getLogger("airrace.somewhere").warning("no compiled kernels: %s", "no compiler")
        logging.getLogger("airrace.somewhere").info("not worth a word")
    assert capsys.readouterr().err == "airrace: warning: no compiled kernels: no compiler\n"


def test_findings_reach_both_people_and_scripts(capsys: pytest.CaptureFixture[str]) -> None:
    finding = Finding("t.yaml", 3, 5, "gates.g1.heading_deg", "missing")
    with pytest.raises(typer.Exit) as left, printed_result(as_json=True):
        raise InputError([finding])
    printed = capsys.readouterr()
    assert left.value.exit_code == 3
    told = json.loads(printed.out)
    assert told["findings"] == [asdict(finding)]
    assert "t.yaml:3:5: gates.g1.heading_deg: missing" in printed.err


@pytest.mark.parametrize("number", [20, 21, 7380])
def test_of_many_findings_the_first_are_printed_and_all_are_counted(
    number: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit), printed_result(as_json=True):
        raise InputError([Finding("t.yaml", line, 1, "", "unknown") for line in range(1, number + 1)])
    printed = capsys.readouterr()
    assert len(json.loads(printed.out)["findings"]) == number
    lines = printed.err.splitlines()
    assert lines[:20] == [f"t.yaml:{line}:1: unknown" for line in range(1, 21)]
    more = ["... (the first 20 are shown; --json has more)"] if number > 20 else []
    assert lines[20:] == [*more, f"airrace: the input is not valid: {number} findings"]


def test_a_finding_cannot_pass_for_another_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit), printed_result(as_json=False):
        raise InputError([Finding("t.yaml\nairrace: all is well\x1b[2J", 1, 1, "", "unknown")])
    assert capsys.readouterr().err == (
        "t.yaml\u240aairrace: all is well\u241b[2J:1:1: unknown\nairrace: the input is not valid: 1 finding\n"
    )


def test_a_bug_is_one_line_unless_debugging(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for debug in ("", "0"):
        monkeypatch.setenv("AIRRACE_DEBUG", debug)
        with pytest.raises(typer.Exit) as left, printed_result(as_json=False):
            raise ValueError("two\nlines")
        printed = capsys.readouterr().err
        assert left.value.exit_code == 1
        assert printed.count("\n") == 1
        assert "this is a bug: ValueError: two lines" in printed
    monkeypatch.setenv("AIRRACE_DEBUG", "1")
    with pytest.raises(typer.Exit), printed_result(as_json=False):
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
        with printed_result(as_json=False) as answer:
            answer.fail(ExitCode.NOT_CERTIFIED, "not certified")
            raise StorageError("disk full")

    with pytest.raises(typer.Exit) as left:
        fail_twice()
    assert left.value.exit_code == 8


@pytest.mark.parametrize("number", [ROWS_SHOWN, ROWS_SHOWN + 3])
def test_a_table_of_many_results_is_cut_and_says_so(number: int) -> None:
    table = Table("", [Column("n", form="g")], [[float(row)] for row in range(number)], ["a note"]).shortened()
    assert [row[0] for row in table.rows] == list(range(ROWS_SHOWN))
    assert table.notes == (("a note",) if number == ROWS_SHOWN else ("a note", "3 more; --output writes all"))
