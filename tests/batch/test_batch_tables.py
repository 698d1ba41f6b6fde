"""The tables of a batch on terminals of any width, and without one."""

import re
import sys
from pathlib import Path

import pytest

from airrace.batch.plan import BatchPlan, JobResult, PlannedJob, RouteSummary
from airrace.batch.ranking import STATES, RankingRow, ranking_of, wind_summaries
from airrace.cli.batch_tables import NAME_MAX, folded, ranking_tables, wind_tables
from airrace.cli.tables import rendered, terminal_columns
from airrace.procedure.stage import STAGES

STYLE = re.compile(r"\x1b\[[0-9;]*m")
LONGEST = max((stage.value for stage in STAGES), key=len)


def rows_of(*pairs: tuple[str, JobResult]) -> list[RankingRow]:
    steps = [PlannedJob(name, "x", "x.yaml", None, (), None) for name, _ in pairs]
    return ranking_of(BatchPlan(Path(), tuple(steps)), [result for _, result in pairs])


PLAIN = rows_of(("half_cuban_eight", JobResult(0, "", 8.821, 28.0)), ("rovinj_2014", JobResult(0, "", 55.753, 31.0)))
WIDEST = rows_of(
    *(
        (
            f"half_cuban_eight,mass_kg=700,speed_kt={code},from_deg=320",
            JobResult(
                code,
                "" if code == 0 else "point-mass: not certified: replay_error 2e-05 > 1e-06",
                100.125 + code,
                1234.5,
                laps=(50.25, 49.875 + code),
                stage=LONGEST,
                routes=RouteSummary("g1: flat", 15, "g1: over the top", 10.125),
            ),
        )
        for code in STATES
    )
)


def on_a_terminal(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)


def shown(rows: list[RankingRow]) -> list[str]:
    """The lines of the tables, on the terminal if there is one."""
    tables = ranking_tables(rows, terminal_columns())
    return [line for table in tables for line in STYLE.sub("", rendered(table)).splitlines()]


@pytest.mark.parametrize("rows", [PLAIN, WIDEST], ids=["plain", "widest"])
@pytest.mark.parametrize("columns", [80, 90, 100, 120, 160, 250])
def test_tables_fit_the_terminal_and_break_no_word(
    rows: list[RankingRow], columns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    on_a_terminal(columns, monkeypatch)
    lines = shown(rows)
    assert max(map(len, lines)) <= columns
    words = set(" ".join(lines).split())
    for row in rows:
        flight = row.result
        assert {*row.state.split(), flight.stage or "-", f"{flight.race_time:.3f}", row.behind_words} <= words
        assert {f"{flight.wall:.1f}", *flight.message.split()} <= words
        assert row.step.name in words or set(folded(row.step.name).split()) <= words
        if flight.routes is not None:
            assert {f"{min(flight.laps):.3f}", str(flight.routes.tried), f"{flight.routes.behind:+.3f}"} <= words


def test_a_name_on_several_lines_is_the_name() -> None:
    for row in (*PLAIN, *WIDEST):
        lines = folded(row.step.name).split("\n")
        assert "".join(line.strip() for line in lines) == row.step.name
        assert max(map(len, lines)) <= NAME_MAX
    assert folded("rovinj_2014") == "rovinj_2014"


def test_without_a_terminal_all_of_a_job_stands_in_one_line() -> None:
    for rows in (PLAIN, WIDEST):
        (table,) = ranking_tables(rows)
        assert [column.header for column in table.columns][-1] == "message"
        lines = rendered(table).splitlines()
        assert all(any(line.startswith(row.step.name) for line in lines) for row in rows)


def test_a_wide_terminal_has_the_same_table_and_no_empty_column(monkeypatch: pytest.MonkeyPatch) -> None:
    piped = shown(PLAIN)
    on_a_terminal(100, monkeypatch)
    told = [line.split() for line in shown(PLAIN)]
    assert told[3:][1:] == [line.split() for line in piped[3:][1:]]
    assert "message" not in " ".join(map(" ".join, told))


def test_jobs_in_several_winds_fit_eighty_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = [("environment.wind.from_deg", "320"), ("rules.n_z_max", "10")]
    steps = [
        PlannedJob(
            f"half_cuban_eight,n_z_max=10,speed_kt={speed},from_deg=320,mass_kg=700", "x", "x.yaml", None, swept, None
        )
        for speed in ("5", "10")
        for swept in [(("environment.wind.speed_kt", speed), *pairs)]
    ]
    summaries = wind_summaries(
        ranking_of(BatchPlan(Path(), tuple(steps)), [JobResult(0, "", 60.0), JobResult(0, "", 61.0)])
    )
    assert steps[1].name in rendered(wind_tables(summaries)[0])
    on_a_terminal(80, monkeypatch)
    for table in wind_tables(summaries, terminal_columns()):
        lines = STYLE.sub("", rendered(table)).splitlines()
        assert max(map(len, lines)) <= 80
        assert "\u2026" not in "".join(lines)
    assert "speed_kt=10," in rendered(wind_tables(summaries, terminal_columns())[0])
