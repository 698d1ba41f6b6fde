"""The reports say what happened, all of it, in the words of whoever reads them."""

import csv
import io
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from batch_examples import flown, job, planned, policy, write_course
from hypothesis import given
from hypothesis import strategies as st
from junitparser import Error, Failure, JUnitXml, Skipped, TestSuite

from airrace.cli.batch_output import NAME_MAX, fold_name, ranking_tables, wind_tables
from airrace.cli.printed_result import render, terminal_columns
from airrace.errors import Finding
from airrace.procedure.stage import STAGES
from airrace.runs.batch import reports
from airrace.runs.batch.planning import BatchPlan, JobResult, PlannedJob, RouteSummary, invalid, result_of
from airrace.runs.batch.record import JobRecord
from airrace.runs.batch.reports import (
    STATES,
    BatchResult,
    batch_table,
    counts,
    fit,
    junit_report,
    markdown_report,
    ranking_of,
    wind_summaries,
    wind_words,
)

FINDING = Finding("tracks/bad, a.yaml", 7, 3, "rules.n_z_mx", "unknown key `n_z_mx`;\ndid you mean `n_z_max`? 100 %")


def a_step(name: str, course: str = "", **swept: str) -> PlannedJob:
    pairs = tuple((key.replace("__", "."), value) for key, value in swept.items())
    flown = course or "course"
    return PlannedJob(name, flown, f"tracks/{flown}.yaml", "configs/edge540.yaml", pairs, None)


def rows_of(*pairs: tuple[PlannedJob, JobResult]) -> list[BatchResult]:
    return ranking_of(BatchPlan(Path("out"), tuple(step for step, _ in pairs)), [result for _, result in pairs])


def csv_of(rows: list[BatchResult]) -> str:
    return batch_table(rows).csv()


ROWS = rows_of(
    (a_step("slow"), JobResult(0, "", 62.5, 12.0)),
    (a_step("bad"), invalid((FINDING,))),
    (a_step("loose"), JobResult(5, "point-mass: not certified: replay", 50.0, 9.0)),
    (a_step("fast"), JobResult(0, "", 60.25, 11.0, ("its process was killed",))),
    (a_step("never"), JobResult(130, "interrupted before it was begun")),
    (a_step("no <way>"), JobResult(4, "gate a | b cannot be reached", None, 3.0)),
)


def test_certified_flights_come_first_by_race_time_then_others_then_those_without() -> None:
    assert [row.step.name for row in ROWS] == ["fast", "slow", "loose", "bad", "never", "no <way>"]
    assert [row.behind for row in ROWS] == [0.0, 2.25, -10.25, None, None, None]  # the fastest certified flight
    assert counts(ROWS) == {
        "certified": 2,
        "not certified": 1,
        "invalid input": 1,
        "interrupted": 1,
        "infeasible": 1,
    }


def test_courses_are_ranked_apart_and_what_five_milliseconds_tell_apart_is_a_tie() -> None:
    times = (("b2", "b", 21.0), ("a1", "a", 10.0), ("b1", "b", 20.0), ("b3", "b", 20.004))
    rows = rows_of(*((a_step(name, course), JobResult(0, "", time)) for name, course, time in times))
    assert [row.step.name for row in rows] == ["b1", "b3", "b2", "a1"]
    assert [row.behind for row in rows] == pytest.approx([0.0, 0.004, 1.0, 0.0])
    assert [row.behind_words for row in rows] == ["best", "tie", "+1.000", "best"]


def test_stage_and_laps_stand_beside_the_race_time() -> None:
    rows = rows_of((a_step("a"), JobResult(0, "", 20.0, stage="point-mass", laps=(10.5, 9.5))))
    assert render(*ranking_tables(rows)).splitlines()[-1].split()[:6] == [
        *("a", "certified", "point-mass", "20.000", "best", "9.500")
    ]
    (line,) = csv.DictReader(io.StringIO(csv_of(rows)))
    assert (line["stage"], line["laps_s"]) == ("point-mass", "10.5 9.5")
    assert "| a | certified | point-mass | 20.000 | best | 0.0 |" in markdown_report(rows, ())


def test_the_csv_holds_every_job_with_every_number_as_it_is_and_every_swept_key() -> None:
    table = list(csv.DictReader(io.StringIO(csv_of(ROWS))))
    assert [line["name"] for line in table] == [row.step.name for row in ROWS]
    assert [line["state"] for line in table] == [row.state for row in ROWS]
    assert [float(table[1]["race_time_s"]), float(table[1]["behind_s"])] == [62.5, 2.25]
    assert table[3]["race_time_s"] == table[3]["behind_s"] == ""
    assert table[0]["retries"] == "1"
    assert table[0]["checkpoint"] == "out/fast.h5"
    rows = rows_of(
        (a_step("x", environment__wind__speed_kt="5"), JobResult(0, "", 10.0)), (a_step("y"), JobResult(0, "", 11.0))
    )
    table = list(csv.DictReader(io.StringIO(csv_of(rows))))
    assert [line["environment.wind.speed_kt"] for line in table] == ["5", ""]


EXPLORED = rows_of(
    (a_step("plain"), JobResult(0, "", 61.0)),
    (
        a_step("bent"),
        JobResult(0, "", 60.0, routes=RouteSummary("a | b: to the left", 7, "a -> b: over the top", 0.125)),
    ),
)


def test_reports_tell_which_way_round_was_flown_and_which_came_next() -> None:
    table = list(csv.DictReader(io.StringIO(csv_of(EXPLORED))))
    assert [line["route"] for line in table] == ["a | b: to the left", ""]
    assert [line["routes_evaluated"] for line in table] == ["7", ""]
    assert [line["next_route"] for line in table] == ["a -> b: over the top", ""]
    assert [line["next_route_behind_s"] for line in table] == ["0.125", ""]
    text = markdown_report(EXPLORED, ())
    assert "| bent | a \\| b: to the left | 7 | a -> b: over the top | +0.125 |" in text.splitlines()
    assert "routes tried" not in markdown_report(ROWS, ())
    shown = render(*ranking_tables(EXPLORED)).splitlines()
    assert shown[-2].split()[:5] == ["bent", "certified", "-", "60.000", "best"]
    assert shown[-2].split()[5:] == ["7", "+0.125", "0.0"]
    assert shown[-1].split()[4:7] == ["+1.000", "-", "-"]
    assert "next route" not in render(*ranking_tables(ROWS))


def test_the_routes_of_a_run_are_those_of_the_stage_that_explored() -> None:
    def routes_of(*routes: dict) -> RouteSummary | None:
        stages = [{"stage": "point-mass", "routes": list(routes)}, {"stage": "six-dof", "routes": []}]
        run = {"race_time_s": 60.0, "stages": stages}
        return result_of(JobRecord(job().fingerprint, ended=True, run=run)).routes

    best, other = ({"route": way, "difference_s": late} for way, late in (("flat", 0.0), ("high", 0.5)))
    assert routes_of(best, other) == RouteSummary("flat", 2, "high", 0.5)
    assert routes_of(best) == RouteSummary("flat", 1)
    assert routes_of() is None


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[BatchResult]]:
    """A batch in which everything happens that can happen."""
    folder = tmp_path_factory.mktemp("mixed")
    course, broken = write_course(folder), write_course(folder, "broken")
    broken.write_text(broken.read_text().replace("n_z_max", "n_z_mx"))
    manners = ["fine", "crash", "infeasible", "not-certified", "hang"]
    plan = planned(course, broken, folder=folder, sweeps=[f"notes={','.join(manners)}"])
    results = flown(plan, policy(timeout=1.5), slots=3)
    plan = BatchPlan(folder, (*plan.steps, a_step("never")), plan.findings)
    return folder, ranking_of(plan, [*results, JobResult(130, "interrupted before it was begun")])


def test_junitparser_reads_back_what_was_written(mixed: tuple[Path, list[BatchResult]], tmp_path: Path) -> None:
    _, rows = mixed
    text = junit_report(rows)
    path = tmp_path / "out.xml"
    path.write_text(text, encoding="utf-8")
    report = JUnitXml.fromfile(str(path))
    suites = {suite.name: suite for suite in report}
    assert list(suites) == [row.step.name for row in rows]
    for row in rows:
        suite = suites[row.step.name]
        told = {one.name: one.value for one in suite.properties()}
        assert told["state"] == row.state
        assert told.get("race_time_s") == (None if row.result.race_time is None else repr(row.result.race_time))
        totals = (suite.tests, suite.failures, suite.errors, suite.skipped)
        suite.update_statistics()
        assert (suite.tests, suite.failures, suite.errors, suite.skipped) == totals
    sums = [sum(getattr(suite, name) for suite in report) for name in ("tests", "failures", "errors", "skipped")]
    assert [report.tests, report.failures, report.errors, report.skipped] == sums
    report.write(str(tmp_path / "again.xml"))
    assert tree(tmp_path / "again.xml") == tree(path)


def test_every_item_of_a_certificate_is_a_test_case(mixed: tuple[Path, list[BatchResult]]) -> None:
    suites = suites_of(mixed)
    fine = next(suite for name, suite in suites.items() if name.endswith("notes=fine"))
    assert [case.name for case in fine] == ["point-mass", "point-mass.kkt_error", "point-mass.path_angle", "run"]
    assert not any(case.result for case in fine)
    loose = next(suite for name, suite in suites.items() if name.endswith("notes=not-certified"))
    (failed,) = [case for case in loose if case.name == "point-mass.path_angle"]
    (failure,) = failed.result
    assert isinstance(failure, Failure)
    assert failure.message == "path_angle is 0.01, its limit 0.0035 rad at 1:start -> 1:g1"


def test_accidents_and_invalid_inputs_are_errors_and_what_was_not_begun_is_skipped(
    mixed: tuple[Path, list[BatchResult]],
) -> None:
    found = {name: [type(one) for case in suite for one in case.result] for name, suite in suites_of(mixed).items()}
    assert found["oval,notes=crash"] == [Error]
    assert found["oval,notes=hang"] == [Error]
    assert found["broken,notes=fine"] == [Error]
    assert found["never"] == [Skipped]
    assert found["oval,notes=infeasible"] == [Failure, Failure]
    assert suites_of(mixed)["oval,notes=crash"].errors == 1


def suites_of(mixed: tuple[Path, list[BatchResult]]) -> dict[str, TestSuite]:
    _, rows = mixed
    return {suite.name: suite for suite in JUnitXml.fromstring(junit_report(rows).encode())}


def tree(path: Path) -> list[tuple[str, dict[str, str], str]]:
    """Elements, attributes and texts of a file."""
    return [
        (one.tag, {name: value for name, value in one.attrib.items() if value}, (one.text or "").strip())
        for one in ElementTree.parse(path).iter()
    ]


@given(st.text(st.characters(exclude_categories=["Cs"])), st.text(st.characters(exclude_categories=["Cs"])))
def test_any_message_survives_junit(message: str, name: str) -> None:
    rows = rows_of((a_step(name or "x"), JobResult(8, message, None, 1.0)))
    (suite,) = JUnitXml.fromstring(junit_report(rows).encode())
    (case,) = suite
    (error,) = case.result
    assert suite.name == fit(name or "x")
    assert error.text == fit(message or "failed")


def test_annotations_lead_to_file_and_line_and_are_escaped() -> None:
    lines = list(reports.annotations(ROWS, ()))
    assert (
        "::error file=tracks/bad%2C a.yaml,line=7,col=3,title=rules.n_z_mx::"
        "unknown key `n_z_mx`;%0Adid you mean `n_z_max`? 100 %25" in lines
    )
    assert any(line.startswith("::error file=tracks/course.yaml,title=no <way>%3A infeasible::") for line in lines)
    assert not any("fast" in line for line in lines)
    assert all("\n" not in line for line in lines)


def test_annotations_of_the_command_line_name_no_file_and_only_so_many_are_made() -> None:
    (line,) = reports.annotations((), (Finding("--sweep", 0, 0, "a.b", "never arrives"),))
    assert line == "::error title=a.b::never arrives"
    findings = [Finding("a.yaml", number, 1, "", "bad") for number in range(1, 200)]
    lines = list(reports.annotations((), findings))
    assert len(lines) == reports.ANNOTATIONS_MAX + 1
    assert "149 more" in lines[-1]


def test_the_summary_of_the_step_is_appended_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "summary.md"
    path.write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(path))
    reports.append_summary("after\n")
    monkeypatch.delenv("GITHUB_STEP_SUMMARY")
    reports.append_summary("nowhere\n")
    assert path.read_text() == "before\nafter\n"


def test_markdown_cells_hold_what_would_break_them() -> None:
    text = markdown_report(ROWS, ())
    assert "| no &lt;way> | infeasible |  |" in text
    table = [line for line in text.splitlines() if line.startswith("|")]
    assert len(table) == 2 + len(ROWS)
    assert {line.replace("\\|", "").count("|") for line in table} == {7}


def test_names_and_messages_are_no_links_mentions_or_code_in_markdown() -> None:
    name = "`[x](http://a.b) @team www.c.d"
    text = markdown_report(rows_of((PlannedJob(name, "x", "x.yaml", None, (), None), JobResult(3, f"bad {name}"))), ())
    assert len([line for line in text.splitlines() if r"\`\[x\](http" in line]) == 2  # the table, and the messages
    assert not re.search(r"(?<!\\)[`\[\]]|://|@(?!<!-- -->)|www\.", text)


@pytest.mark.parametrize("name", ["=1+1", "+a", "-a", "@a", "::error::a"])
def test_no_cell_of_the_table_is_a_formula_and_numbers_stay_numbers(name: str) -> None:
    swept = (("environment.wind.north_kt", "-5"),)
    rows = rows_of((PlannedJob(name, "x", "x.yaml", None, swept, None), JobResult(0, "", -1.5)))
    head, row = csv.reader(io.StringIO(batch_table(rows).csv()))
    told = dict(zip(head, row, strict=True))
    assert told["name"] == f"'{name}"
    assert (told["race_time_s"], told["environment.wind.north_kt"]) == ("-1.5", "-5")


def windy(time: dict[tuple[int, int], float], unit: str = "speed_kt") -> list[BatchResult]:
    pairs = []
    for (speed, degrees), seconds in time.items():
        swept = (("environment.wind." + unit, str(speed)), ("environment.wind.from_deg", str(degrees)))
        step = PlannedJob(f"x,{speed},{degrees}", "x", "x.yaml", None, swept, None)
        pairs.append((step, JobResult(0, "", seconds)))
    return rows_of(*pairs)


def test_a_sweep_over_the_wind_tells_best_worst_and_what_a_knot_costs_from_where() -> None:
    rows = windy({(s, d): 60.0 + (0.2 if d == 90 else -0.1) * s for s in (0, 5, 10) for d in (0, 90)})
    (summary,) = wind_summaries(rows)
    assert wind_words(summary.best) == "10 kt from 0"
    assert wind_words(summary.worst) == "10 kt from 90"
    assert [one.from_deg for one in summary.bearings] == ["0", "90"]
    assert [one.per_knot for one in summary.bearings] == pytest.approx([-0.1, 0.2])
    assert [one.mean for one in summary.bearings] == pytest.approx([59.5, 61.0])
    assert summary.per_knot == pytest.approx(0.05)


def test_slopes_are_per_knot_and_one_speed_has_none() -> None:
    (summary,) = wind_summaries(windy({(s, 0): 60.0 + s for s in (0, 1, 2)}, unit="speed_m_s"))
    assert summary.per_knot == pytest.approx(1852.0 / 3600.0)
    (summary,) = wind_summaries(windy({(5, 0): 60.0, (5, 90): 61.0}))
    assert summary.per_knot is None
    assert wind_summaries(windy({(5, 0): 60.0})) == []


def test_only_certified_flights_count_and_other_sweeps_are_told_apart() -> None:
    def row(speed: str, limit: str, result: JobResult) -> tuple[PlannedJob, JobResult]:
        swept = (("environment.wind.speed_kt", speed), ("rules.n_z_max", limit))
        return PlannedJob(f"x,{speed},{limit}", "x", "x.yaml", None, swept, None), result

    rows = rows_of(
        row("0", "9", JobResult(0, "", 60.0)),
        row("5", "9", JobResult(0, "", 61.0)),
        row("0", "10", JobResult(0, "", 50.0)),
        row("5", "10", JobResult(5, "not certified", 40.0)),
        row("10", "10", JobResult(0, "", 52.0)),
        row("null", "10", JobResult(0, "", 50.0)),
    )
    summaries = {summary.title: summary for summary in wind_summaries(rows)}
    assert set(summaries) == {"x, rules.n_z_max=9", "x, rules.n_z_max=10"}
    assert summaries["x, rules.n_z_max=10"].per_knot == pytest.approx(0.2)
    assert summaries["x, rules.n_z_max=10"].flights == 3


STYLE = re.compile(r"\x1b\[[0-9;]*m")
LONGEST = max((stage.value for stage in STAGES), key=len)


def ranking(*pairs: tuple[str, JobResult]) -> list[BatchResult]:
    steps = [PlannedJob(name, "x", "x.yaml", None, (), None) for name, _ in pairs]
    return ranking_of(BatchPlan(Path(), tuple(steps)), [result for _, result in pairs])


PLAIN = ranking(("half_cuban_eight", JobResult(0, "", 8.821, 28.0)), ("rovinj_2014", JobResult(0, "", 55.753, 31.0)))
WIDEST = ranking(
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


def shown(rows: list[BatchResult]) -> list[str]:
    """The lines of the tables, on the terminal if there is one."""
    tables = ranking_tables(rows, terminal_columns())
    return [line for table in tables for line in STYLE.sub("", render(table)).splitlines()]


@pytest.mark.parametrize("rows", [PLAIN, WIDEST], ids=["plain", "widest"])
@pytest.mark.parametrize("columns", [80, 100, 120, 250])
def test_tables_fit_the_terminal_and_break_no_word(
    rows: list[BatchResult], columns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    on_a_terminal(columns, monkeypatch)
    lines = shown(rows)
    assert max(map(len, lines)) <= columns
    words = set(" ".join(lines).split())
    for row in rows:
        flight = row.result
        assert {*row.state.split(), flight.stage or "-", f"{flight.race_time:.3f}", row.behind_words} <= words
        assert {f"{flight.wall:.1f}", *flight.message.split()} <= words
        assert row.step.name in words or set(fold_name(row.step.name).split()) <= words
        if flight.routes is not None:
            assert {f"{min(flight.laps):.3f}", str(flight.routes.tried), f"{flight.routes.behind:+.3f}"} <= words


def test_a_name_on_several_lines_is_the_name() -> None:
    for row in (*PLAIN, *WIDEST):
        lines = fold_name(row.step.name).split("\n")
        assert "".join(line.strip() for line in lines) == row.step.name
        assert max(map(len, lines)) <= NAME_MAX
    assert fold_name("rovinj_2014") == "rovinj_2014"


def test_without_a_terminal_and_on_a_wide_one_all_of_a_job_stands_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for rows in (PLAIN, WIDEST):
        (table,) = ranking_tables(rows)
        assert [column.name for column in table.columns][-1] == "message"
        lines = render(table).splitlines()
        assert all(any(line.startswith(row.step.name) for line in lines) for row in rows)
    piped = shown(PLAIN)
    on_a_terminal(100, monkeypatch)
    lines = shown(PLAIN)
    assert [line.split() for line in lines[4:]] == [line.split() for line in piped[4:]]
    assert "message" not in " ".join(lines)


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
    assert steps[1].name in render(wind_tables(summaries)[0])
    on_a_terminal(80, monkeypatch)
    for table in wind_tables(summaries, terminal_columns()):
        lines = STYLE.sub("", render(table)).splitlines()
        assert max(map(len, lines)) <= 80
        assert "\u2026" not in "".join(lines)
    assert "speed_kt=10," in render(wind_tables(summaries, terminal_columns())[0])
