"""Routes at the command line: what is asked for reaches the settings, and what was tried is told."""

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import fake_optimizer
import pytest
from command import run
from fake_optimizer import stage_result

import airrace
from airrace.cli import run_screen
from airrace.cli.printed_result import render
from airrace.cli.run_tables import ROUTES_MAX
from airrace.errors import OutOfTime
from airrace.files.checkpoint import read_checkpoint
from airrace.files.inputs import load_inputs
from airrace.flights.results import Flight
from airrace.flights.results.clearances import Clearance, NearMiss
from airrace.pages.views.stage_tables import search_table
from airrace.procedure import procedure
from airrace.procedure.result import BoundedWindow, LowerBound, Route, SearchReport, StageResult
from airrace.procedure.stage import Stage
from airrace.runs import json_objects
from airrace.runs.json_objects import run_object, stage_object

TRACK = Path(__file__).parents[2] / "tracks" / "rovinj_2014.yaml"
PASSINGS = [passage.name for passage in load_inputs(TRACK).race.course.passages]
STYLE = re.compile(r"\x1b\[[0-9;]*m")
LOOP = "g6 -> g7: turns 340 degrees on 900 m, where the gates ask for 20 degrees on 160 m"


def explored(routes: int = 3, loops: tuple[str, ...] = ()) -> SearchReport:
    tried = tuple(
        Route(
            f"1:g{number} -> 1:g{number + 1}: over the top to the right, {100 + number} m high",
            10.0 + 0.125 * number,
            0.125 * number,
            "window" if number else "joint",
        )
        for number in range(routes)
    )
    return SearchReport(tried, converged_to_best=3, converged_elsewhere=1, failed=1, seconds=4.5, loops=loops)


def contested(found: SearchReport, own: StageResult | None = None) -> StageResult:
    own = own or stage_result(Stage.POINT_MASS, passings=PASSINGS)
    return replace(own, search=found, alternatives=(beside(own, 20.0), beside(own, 40.0)))


def beside(own: StageResult, metres: float) -> StageResult:
    """The same flight so much farther east: another one."""
    trajectory = own.trajectory
    state = trajectory.state.copy()
    state[[quantity.name for quantity in trajectory.states].index("y")] += metres
    return replace(own, trajectory=replace(trajectory, state=state))


@pytest.fixture
def folder(fake_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, and a procedure that has explored."""

    def optimize(*arguments: Any, **named: Any) -> Iterator[StageResult]:
        for result in fake_optimizer.optimize(*arguments, **named):
            yield contested(explored(loops=(LOOP,)), result) if result.stage is Stage.POINT_MASS else result

    monkeypatch.setattr(procedure, "optimize", optimize)
    return fake_folder


def settings_of(folder: Path) -> dict[str, Any]:
    return json.loads(read_checkpoint(folder / "rovinj_2014.h5").inputs.resolved)["settings"]


def test_search_and_alternatives_reach_the_settings_and_are_kept_as_overrides(folder: Path) -> None:
    assert run("optimize", TRACK, "--quiet").code == 0
    assert (settings_of(folder)["search"], settings_of(folder)["alternatives"]) == ("quick", None)
    for search in ("off", "quick", "thorough"):
        assert run("optimize", TRACK, "--search", search, "--alternatives", "3", "--quiet", "--force").code == 0
        assert (settings_of(folder)["search"], settings_of(folder)["alternatives"]) == (search, 3)
        stored = read_checkpoint(folder / "rovinj_2014.h5").inputs.overrides
        assert stored == (f"settings.search={search}", "settings.alternatives=3")


def test_gap_asks_for_a_thorough_search(folder: Path) -> None:
    assert run("optimize", TRACK, "--gap", "0.002", "--quiet").code == 0
    assert (settings_of(folder)["search"], settings_of(folder)["gap"]) == ("thorough", 0.002)


BOUND = LowerBound(9.9, 10.0, 3, 17, 400, 30, (BoundedWindow("1:g1 -> 1:g4", 3, 0.1, 15),))
GAP = "no flight is more than 1.00 % (0.10 s) faster"


def test_gap_is_told_stored_and_in_the_object(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def optimize(*arguments: Any, **named: Any) -> Iterator[StageResult]:
        for result in fake_optimizer.optimize(*arguments, **named):
            if result.stage is Stage.POINT_MASS:
                result = replace(result, search=replace(explored(), bound=BOUND))
            yield result

    monkeypatch.setattr(procedure, "optimize", optimize)
    assert GAP in " ".join(run("optimize", TRACK).out.split())
    (stage,) = [stage for stage in run("show", "rovinj_2014.h5", "--json").answer["stages"] if stage["search"]]
    bound = stage["search"]["bound"]
    assert (bound["on_mesh_s"], bound["race_time_on_mesh_s"], bound["starts"]) == (9.9, 10.0, 17)
    assert bound["windows"] == [{"text": "1:g1 -> 1:g4", "legs": 3, "slack_s": 0.1, "solved": 15}]
    assert bound["gap"] == pytest.approx(0.01)
    assert bound["text"].startswith(GAP)


def test_search_that_was_stopped_says_so_on_the_screen_and_in_the_object(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a point mass that is finished several times the last one is kept."""

    def optimize(*arguments: Any, **named: Any) -> Iterator[StageResult]:
        for result in fake_optimizer.optimize(*arguments, **named):
            if result.stage is Stage.HOMOTOPY:
                yield result
                continue
            for bound in (replace(BOUND, seconds=0.0, windows=(), stopped=True), replace(BOUND, stopped=True)):
                yield replace(result, search=replace(explored(), bound=bound))
            raise OutOfTime

    monkeypatch.setattr(procedure, "optimize", optimize)
    ran = run("optimize", TRACK, "--timeout", "30")
    assert ran.code == 6
    assert "airrace resume rovinj_2014.h5" in ran.err
    assert ran.err.count("; the search goes on by prices\n") == 2
    text = " ".join(ran.out.split())
    assert GAP in text
    assert "the search by prices was stopped before its end" in text
    homotopy, point_mass = run("show", "rovinj_2014.h5", "--json").answer["stages"]
    assert homotopy["stage"] == "homotopy"
    assert point_mass["search"]["bound"]["stopped"] is True
    assert [step["action"] for step in run("resume", "rovinj_2014.h5", "-n", "--json").answer["steps"]][:2] == [
        "keep"
    ] * 2


@pytest.mark.parametrize(
    "wrong",
    [
        ("--search", "fast"),
        ("--search", ""),
        ("--alternatives", "0"),
        ("--alternatives", "21"),
        ("--alternatives", "two"),
        ("--gap", "2"),
        ("--gap", "-0.1"),
        ("--gap", "nan"),
        ("--gap", "0.01", "--search", "quick"),
        ("--gap", "0.01", "--start", "other.h5"),
    ],
)
def test_options_that_mean_nothing_are_refused(folder: Path, wrong: tuple[str, ...]) -> None:
    ran = run("optimize", TRACK, *wrong)
    assert ran.code == 2
    assert wrong[0] in ran.err
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("search: fast", "search"),
        ("search: Off", "search"),
        ("search: 1", "search"),
        ("gap: 1.5", "gap"),
        ("alternatives: 0", "alternatives"),
        ("alternatives: 21", "alternatives"),
        ("alternatives: 1.5", "alternatives"),
        ("alternatives: many", "alternatives"),
        ("searches: off", "search"),
    ],
)
def test_wrong_settings_are_found_in_their_line(folder: Path, line: str, words: str) -> None:
    (folder / "wrong.yaml").write_text(f"schema: airrace/settings/1\n{line}\n")
    ran = run("optimize", TRACK, "--settings", "wrong.yaml", "--json")
    assert ran.code == 3
    (finding,) = ran.answer["findings"]
    assert (finding["file"], finding["line"]) == ("wrong.yaml", 2)
    assert words in str(finding)


@pytest.mark.parametrize("chosen", ["settings.search=fast", "settings.alternatives=0"])
def test_wrong_overrides_are_refused(folder: Path, chosen: str) -> None:
    ran = run("optimize", TRACK, "--set", chosen, "--json")
    assert ran.code == 3
    assert chosen.split("=")[0].removeprefix("settings.") in str(ran.answer["findings"])


def missed(flight: Flight) -> tuple[NearMiss, ...]:
    """A near miss behind the first passing."""
    first, second, *_ = flight.crossings
    away = Clearance("pylon", "g4", 0.25, 0.5, 0.02, 0.0, 0.0, 20.0)
    return (NearMiss(away, first, first, second),)


def test_optimize_resume_and_show_warn_of_the_same_near_misses_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_screen, "near_misses", missed)
    monkeypatch.setattr(json_objects, "near_misses", missed)
    commands = (("optimize", TRACK), ("resume", "rovinj_2014.h5"), ("show", "rovinj_2014.h5"))
    for command in commands:
        ran = run(*command)
        assert ran.code == 0
        assert ran.out.count("note: the wing is 0.25 m from pylon g4 0.02 s after 0:g0, required 0.5 m\n") == 1
        assert "near misses\n" not in ran.out
    assert re.search(r"near misses\n.*?0\.02 s after", run(*commands[-1], "--all").out, re.DOTALL)
    assert "pylon g4" not in run("optimize", TRACK, "--quiet", "--force").out
    answers = [run(*command, "--json").answer for command in (("optimize", TRACK, "--force"), *commands[1:])]
    answers.append(airrace.open("rovinj_2014.h5").as_object())
    objects = [[stage.get("near_misses") for stage in answer["stages"]] for answer in answers]
    assert [one["name"] for one in objects[0][-1]] == ["g4"]
    assert objects[0][:-1] == [None] * (len(objects[0]) - 1)
    assert objects[0] == objects[1] == objects[2] == objects[3]


def test_routes_are_told_of_the_stage_that_explored_when_others_are_flown_after_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def optimize(*_: Any, **__: Any) -> Iterator[StageResult]:
        yield contested(explored(loops=(LOOP,)))
        yield stage_result(Stage.TRANSFER_FUNCTION, passings=PASSINGS)

    monkeypatch.setattr(procedure, "optimize", optimize)
    flown, shown = run("optimize", TRACK, "--routes"), run("show", "rovinj_2014.h5", "--no-verify", "--routes")
    assert (flown.code, shown.code) == (0, 0)
    assert "routes" not in run("show", "rovinj_2014.h5", "--no-verify").out
    for told in (flown.out, shown.out):
        assert told.count("routes: 3 tried in 4.5 s, 3 of 5 multistarts converged to the best") == 1
        assert "over the top to the right" in told
        assert "+0.125" in told
    assert f"note: a needless loop: {LOOP}" in " ".join(shown.out.split())


def test_json_tells_the_same_routes_when_flown_and_when_shown(folder: Path) -> None:
    flown = run("optimize", TRACK, "--json").answer["stages"][-1]
    shown = run("show", "rovinj_2014.h5", "--json").answer["stages"][-1]
    for stage in (flown, shown):
        assert stage["routes"] == [
            {
                "route": route.text,
                "race_time_s": route.race_time,
                "difference_s": route.difference,
                "evaluated_by": route.evaluated_by,
                "rolls": route.rolls,
            }
            for route in explored().routes
        ]
        assert stage["search"] == {
            "seconds": 4.5,
            "converged_to_best": 3,
            "converged_elsewhere": 1,
            "failed": 1,
            "loops": [LOOP],
            "bound": None,
        }
        assert stage["alternatives"] == [{"race_time_s": 10.0, "status": "certified", "certified": True}] * 2


def test_stage_that_has_not_explored_tells_no_routes() -> None:
    told = stage_object(stage_result(Stage.POINT_MASS))
    assert (told["routes"], told["search"], told["alternatives"]) == ([], None, [])


def test_routes_that_roll_otherwise_and_hardly_cost_time_share_a_line() -> None:
    """Of one such route, of those that cost more, and of those that differ in more than rolls, each has its own.

    What they are called, in whatever words, decides nothing.
    """

    def rolling(behind: float, leg: int) -> Route:
        return Route(f"1:g{leg} -> 1:g{leg + 1}: straight, flat", 10.0, behind, "window", rolls=True)

    best, slower = Route("no long turns", 10.0, 0.0, "joint"), rolling(0.016, 9)
    turned = Route("1:rolling -> 1:g2: rolling left through level", 10.0, 0.002, "window")
    near = [rolling(0.001 * leg, leg) for leg in (1, 4, 7)]
    shown = " ".join(render(search_table(SearchReport((best, *near, slower, turned)))).split())
    assert shown.count("straight, flat") == 1
    assert "1:rolling -> 1:g2" in shown
    assert "3 routes that roll otherwise on a leg, the last of them 7 ms behind" in shown.replace(" 10.000 +0.001", "")
    assert "1:g4 -> 1:g5: straight" in " ".join(render(search_table(SearchReport((best, near[1])))).split())


def test_the_route_of_the_flight_is_no_best_where_another_is_ahead_on_the_coarse_mesh() -> None:
    own = Route("no long turns", 10.0, 0.0, "joint")
    ahead = [Route(f"1:g{leg} -> 1:g{leg + 1}: flat", 10.0, -0.002 * leg, "window", rolls=True) for leg in (1, 4)]
    shown = " ".join(render(search_table(SearchReport((own, *ahead), converged_to_best=1))).split())
    assert "best" not in shown
    assert "no long turns 10.000 chosen" in shown
    assert "1 of 1 multistarts converged to the chosen one" in shown
    assert "the last of them 2 ms ahead" in shown


def test_object_of_a_route_without_a_number_is_json() -> None:
    lost = replace(explored(1), routes=(Route("nowhere", float("nan"), float("inf"), "window"),))
    text = json.dumps(run_object("t", [contested(lost)], 1.0, certified=True), allow_nan=False)
    assert json.loads(text)["stages"][0]["routes"][0]["race_time_s"] is None


@pytest.mark.parametrize("count", [1, ROUTES_MAX, ROUTES_MAX + 1, 40])
def test_table_shows_the_first_routes_and_counts_the_others(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    lines = STYLE.sub("", render(search_table(explored(count), most=ROUTES_MAX))).splitlines()
    told = [line for line in lines if "over the top" in line]
    assert len(told) == min(count, ROUTES_MAX)
    assert " best " in told[0]
    assert not any(" best " in line for line in told[1:])
    assert any(f"and {count - ROUTES_MAX} more" in line for line in lines) is (count > ROUTES_MAX)


@pytest.mark.parametrize("columns", ["40", "60", "80"])
def test_long_words_are_folded_and_never_cut(columns: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    whole = "; ".join(route.text for route in explored(6).routes)
    long = replace(explored(1), routes=(Route(whole, 10.0, 0.0, "joint"),))
    shown = STYLE.sub("", render(search_table(long)))
    assert "\u2026" not in shown
    for word in whole.split():
        assert word in shown


def test_markup_in_names_is_shown_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    odd = replace(explored(1), routes=(Route("1:[bold]g1[/bold] -> [red]: straight, flat", 10.0, 0.0, "joint"),))
    assert "1:[bold]g1[/bold] -> [red]: straight, flat" in render(search_table(odd))
