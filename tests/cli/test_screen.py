"""The answer of a run: it fits one screen, whatever the width, and says first what matters most."""

import re
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import fake_optimizer
import pytest
from command import run
from example_courses import ROOT
from fake_optimizer import solve_roughly, solve_single_mesh, stage_result

from airrace.cli.main import app
from airrace.cli.printed_result import command_lines
from airrace.cli.run_screen import REMARKS_MAX, Parts, StoredStages, next_commands, run_texts, solved_stages
from airrace.files.inputs import Document, load_inputs
from airrace.files.inputs.objects import CourseAndAir, document_of_objects
from airrace.pages.views.stage_tables import verdict_words
from airrace.procedure import procedure
from airrace.procedure.result import Note, NoteKind, SearchReport, StageResult, Status, SuggestedChange
from airrace.procedure.stage import STAGES, Stage
from airrace.runs.run_state import RunState, new_run, open_run
from airrace.runtime.standard_streams import STANDARD, name_of

STYLE = re.compile(r"\x1b\[[0-9;]*m")
PASSINGS = [passage.name for passage in load_inputs("rovinj_2014").race.course.passages]
LOOPS = tuple(f"g{number} -> g{number + 1}: turns 340 degrees on 900 m" for number in range(5))

Show = Callable[..., list[str]]


@pytest.fixture
def at(fake_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Show:
    """What a command prints on a terminal of so many columns, line by line, without colours."""

    def shown(columns: int, *arguments: str) -> list[str]:
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        app(arguments, standalone_mode=False)
        return STYLE.sub("", capsys.readouterr().out).splitlines()

    return shown


@pytest.fixture
def state(fake_folder: Path) -> RunState:
    """A finished run."""
    assert run("optimize", "rovinj_2014", "--quiet").code == 0
    return open_run(Path("rovinj_2014.h5"))


def after(state: RunState, result: StageResult) -> StoredStages:
    """What is shown of a run that ends with this stage."""
    return solved_stages(state.with_stage(result))


def told(shown: StoredStages, **parts: bool) -> str:
    """What is printed, in one line."""
    return " ".join(" ".join(run_texts(shown, Parts(**parts))).split())


def flown(stage: Stage = Stage.SIX_DOF, **named: Any) -> StageResult:
    return replace(stage_result(stage, passings=PASSINGS), **named)


@pytest.mark.parametrize("columns", [40, 80, 120])
def test_no_line_is_wider_than_the_terminal(columns: int, at: Show) -> None:
    commands = [
        ("optimize", "rovinj_2014"),
        ("optimize", "rovinj_2014", "--force", "--all"),
        ("show", "rovinj_2014.h5"),
        ("show", "rovinj_2014.h5", "--all", "--legs"),
        ("show", "rovinj_2014.h5", "--no-verify", "--stages", "--routes", "--certificate"),
        ("brief", "rovinj_2014.h5"),
        *[("check", name) for name in ("rovinj_2014", "half_cuban_eight", "abu_dhabi_2016")],
    ]
    for command in commands:
        lines = at(columns, *command)
        assert lines
        assert [line for line in lines if len(line) > columns] == [], command


def test_the_answer_of_a_race_of_two_laps_fits_forty_lines(at: Show) -> None:
    at(80, "optimize", "rovinj_2014", "--quiet")
    lines = at(80, "show", "rovinj_2014.h5")
    assert len(PASSINGS) == 17
    assert len(lines) <= 40
    assert lines[0] == "point-mass: 10.000 s, certified: local optimum; verified"
    assert lines[1].startswith("Edge 540")
    assert lines[-2:] == ["next: airrace brief rovinj_2014.h5", "      airrace resume rovinj_2014.h5"]
    for words in ("stages", "routes", "kkt_error", "least distances"):
        assert not any(words in line for line in lines)


@pytest.mark.parametrize(
    ("result", "words"),
    [
        (stage_result(Stage.SIX_DOF), "certified: local optimum"),
        (solve_single_mesh(stage_result(Stage.SIX_DOF)), "solved on one mesh: local optimum"),
        (solve_roughly(stage_result(Stage.STATE_SPACE)), "solved on one mesh, as closely as the next stage needs"),
        (stage_result(Stage.HOMOTOPY), "a guess, no optimum"),
        (stage_result(Stage.SIX_DOF, kkt_error=1.0), "NOT certified: kkt_error"),
        (stage_result(Stage.SIX_DOF, Status.NOT_CERTIFIED), "NOT certified"),
        (stage_result(Stage.SIX_DOF, Status.INFEASIBLE), "no flight: infeasible"),
    ],
)
def test_the_verdict_is_a_few_words_or_the_item_that_fails(result: StageResult, words: str) -> None:
    assert verdict_words(result) == words


@pytest.mark.parametrize(
    ("result", "words"),
    [
        (solve_single_mesh(flown()), "six-dof: 10.000 s, solved on one mesh: local optimum"),
        (stage_result(Stage.SIX_DOF, kkt_error=1.0, passings=PASSINGS), "six-dof: 10.000 s, NOT certified: kkt_error"),
    ],
)
def test_the_verdict_stands_in_the_first_line_alone(state: RunState, result: StageResult, words: str) -> None:
    shown = after(state, result)
    verdict, what, *_ = next(run_texts(shown, Parts())).splitlines()
    assert verdict == words
    assert what.startswith("Edge 540")
    assert "certified" not in what
    assert "mesh" not in what
    assert what in shown.stamps[Stage.SIX_DOF].text


def test_a_guess_shows_no_race_time(at: Show, monkeypatch: pytest.MonkeyPatch) -> None:
    def faster(*arguments: Any, **named: Any) -> Iterator[StageResult]:
        for result in fake_optimizer.optimize(*arguments, **named):
            if result.stage is Stage.HOMOTOPY:
                flight, splits = result.trajectory, [replace(one, time=0.9125 * one.time) for one in result.splits]
                flight = replace(flight, time=0.9125 * flight.time, durations=0.9125 * flight.durations)
                result = replace(result, trajectory=flight, splits=tuple(splits))
            yield result

    monkeypatch.setattr(procedure, "optimize", faster)
    ran = run("optimize", "rovinj_2014", "--stages", "--output", "x.h5")
    assert "9.125" not in ran.out + ran.err
    assert "homotopy: solved, a guess, 12 iterations" in ran.err
    assert re.search(r"\nhomotopy +a guess +- ", ran.out)
    assert "9.125" not in open_run(Path("x.h5"))._repr_html_()
    assert "9.125" not in "\n".join(at(80, "show", "x.h5", "--stage", "homotopy", "--no-verify")).partition("\n\n")[0]


def test_the_most_important_remarks_are_reported_and_the_others_counted(state: RunState) -> None:
    note = Note(NoteKind.MESH_CHECK, "the race time was not confirmed")
    result = flown(search=SearchReport(loops=LOOPS), notes=(note,))
    text = told(after(state, result))
    assert text.index("note: six-dof: the race time was not confirmed") < text.index(
        f"note: a needless loop: {LOOPS[0]}"
    )
    assert text.count("note: ") == REMARKS_MAX == 3
    assert "3 more with --all" in text
    text = told(after(state, result), every=True)
    assert text.count("note: ") == 6
    assert "with --all" not in text


def test_what_is_claimed_of_the_curvature_stands_in_the_certificate_alone(state: RunState) -> None:
    shown = after(state, flown())
    assert "a local minimum" not in told(shown, stages=True, routes=True)
    assert "certified: a local minimum, all limits measured" in told(shown, certificate=True)


def test_the_next_commands_suit_what_became_of_the_run(state: RunState) -> None:
    def commands(result: StageResult) -> list[str]:
        return [" ".join(words) for words in next_commands(after(replace(state, path=Path("x.h5")), result))]

    assert list(STAGES)[-1] is Stage.SIX_DOF
    assert commands(flown()) == ["airrace brief x.h5", "airrace report x.h5"]
    assert commands(flown(Stage.POINT_MASS)) == ["airrace brief x.h5", "airrace resume x.h5"]
    failed = stage_result(Stage.SIX_DOF, kkt_error=1.0, passings=PASSINGS)
    assert commands(failed) == ["airrace show x.h5 --certificate", "airrace resume x.h5"]
    assert commands(stage_result(Stage.POINT_MASS, Status.TIMEOUT)) == ["airrace resume x.h5"]
    assert next_commands(after(replace(state, path=None), flown())) == []
    asked = load_inputs("rovinj_2014", overrides=["rules.reserve.probability=0.9"])
    state = replace(state, inputs=asked)  # of which no attempt has ended
    assert commands(flown()) == ["airrace brief x.h5", "airrace resume x.h5"]


def infeasible(*changes: tuple[int, str, float]) -> StageResult:
    """A stage without a flight: conflict, key and value of every suggested change."""
    suggested_changes = tuple(
        SuggestedChange(conflict, f"{conflict}:g1", key, "a limit", "", 1.0, needed, 9.9)
        for conflict, key, needed in changes
    )
    return replace(stage_result(Stage.POINT_MASS, Status.INFEASIBLE), suggested_changes=suggested_changes)


def test_a_course_that_cannot_be_flown_is_flown_next_with_one_change_and_all_else_as_it_was(fake_folder: Path) -> None:
    """Values that were set by hand stay, but for those that the change replaces."""
    shutil.copy(ROOT / "configs" / "edge540.yaml", "mine.yaml")
    Path("careful.yaml").write_text("schema: airrace/settings/1\n")
    values = ("rules.ceiling_m=120", "rules.roll_rate_max_deg_s=300")
    options = ["--aircraft", "mine.yaml", "--settings", "careful.yaml"]
    overrides = [word for one in values for word in ("--set", one)]
    assert run("optimize", "rovinj_2014", *options, *overrides, "--quiet").code == 0
    result = infeasible((1, "", -12.0), (1, "rules.ceiling_m", 195.0), (1, "rules.n_z_max", 11.0))
    (words,) = next_commands(after(open_run(Path("rovinj_2014.h5")), result))
    assert words == [
        *("airrace", "optimize", "rovinj_2014", *options, "--set", "rules.roll_rate_max_deg_s=300"),
        *("--set", "rules.ceiling_m=195", "--output", "NEW.h5"),
    ]
    assert run(*words[1:], "--quiet").code == 0
    flown, before = (open_run(Path(name)).inputs for name in ("NEW.h5", "rovinj_2014.h5"))
    assert (flown.aircraft, flown.settings_file) == (before.aircraft, before.settings_file)
    assert flown.race.course.rules.height.upper == 195.0


@pytest.mark.parametrize(
    "changes",
    [
        [(1, "rules.ceiling_m", 195.0), (2, "rules.n_z_max", 11.0)],  # never flown together
        [(1, "rules.ceiling_m", 195.0), (2, "", 0.0)],
        [(1, "", 0.0)],
    ],
)
def test_no_command_is_suggested_with_which_no_flight_was_found(
    changes: list[tuple[int, str, float]], state: RunState
) -> None:
    assert next_commands(after(state, infeasible(*changes))) == []


def test_no_command_names_a_document_that_has_no_file(state: RunState) -> None:
    piped = Document(name_of(STANDARD), state.inputs.track.text)
    built = document_of_objects(CourseAndAir(state.inputs.race.course, state.inputs.race.air), "mine")
    for document in (piped, built):
        inputs = load_inputs(document, aircraft=state.inputs.aircraft)
        shown = after(new_run(inputs, Path("x.h5")), infeasible((1, "rules.ceiling_m", 195.0)))
        assert next_commands(shown) == []


def test_a_command_is_broken_as_a_shell_reads_it(monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["airrace", "resume", "my run.h5", "--set", "rules.n_z_max=9", "--output", "a very long name.h5"]
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    for columns in (30, 40, 200):
        monkeypatch.setenv("COLUMNS", str(columns))
        text = command_lines(words, "next: ")
        assert max(map(len, text.splitlines())) <= columns
        assert ("\n" in text) is (columns < 200)
        joined = text.replace("\\\n", "")  # as a shell joins lines
        assert shlex.split(joined.removeprefix("next: ")) == words
