"""Tables for people: no number is cut short, none has a sign it does not deserve."""

import re
import sys

import pytest
from canned_procedure import stage_result

from airrace.cli.tables import certificate_table, rendered, result_tables, stages_table
from airrace.optimal_control.certificate import Certificate, Item
from airrace.procedure.result import Outcome, Stage

STYLE = re.compile(r"\x1b\[[0-9;]*m")


@pytest.mark.parametrize("columns", ["20", "60", "80", "200"])
def test_no_terminal_is_too_narrow_for_a_number(columns: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    result = stage_result(Stage.POINT_MASS)
    for table in (stages_table([result]), *result_tables(result)):
        assert "\u2026" not in rendered(table)


def test_the_tables_of_a_stage_fit_eighty_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    result = stage_result(Stage.POINT_MASS)
    for table in result_tables(result):
        lines = STYLE.sub("", rendered(table)).splitlines()
        assert max(map(len, lines)) <= 80


def test_a_stage_without_a_flight_shows_no_splits() -> None:
    for outcome in (Outcome.INFEASIBLE, Outcome.NOT_CONVERGED, Outcome.TIMEOUT):
        shown = "".join(rendered(table) for table in result_tables(stage_result(Stage.POINT_MASS, outcome)))
        assert "1:g1" not in shown


def test_angles_are_shown_in_degrees_and_a_failed_item_in_capitals() -> None:
    items = (Item("rate", 0.01, 0.02, "rad/s"), Item("bank", 0.02, 0.01, "rad", "phase 3"))
    rate, bank = rendered(certificate_table(Certificate("solved", items))).splitlines()[-2:]
    assert rate.split() == ["rate", "0.573", "1.15", "deg/s", "yes"]
    assert bank.split() == ["bank", "1.15", "0.573", "deg", "NO", "phase", "3"]


def test_what_is_nowhere_violated_has_no_worst_place() -> None:
    items = (Item("rate", 0.0, 0.02, "", "phase 3"),)
    assert "phase 3" not in rendered(certificate_table(Certificate("solved", items)))
