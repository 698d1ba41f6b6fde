"""A run in a line, and as a piece of HTML for notebooks."""

from collections.abc import Sequence

from airrace.planning.race import Race
from airrace.procedure.result import StageResult, State
from airrace.runs.run_object import is_certified, verdict
from airrace.runs.splits import Splits
from airrace.views.map_model import map_model
from airrace.views.plain_text import escaped
from airrace.views.plan_svg import plan_svg
from airrace.views.stage_tables import certificate_table
from airrace.views.tables import Column, Table

STAGES = (
    Column("stage"),
    Column("race time", "s", ".3f"),
    Column("state"),
    Column("iterations", form="d"),
    Column("wall", "s", ".1f"),
)


def run_line(name: str, results: Sequence[StageResult]) -> str:
    """Return a line that says which run it is, how far it has come and whether it is certified."""
    if not results:
        return f"{name}: no stage is finished yet"
    last = results[-1]
    race_time = f"{last.trajectory.race_time:.3f} s" if last.is_flight else last.outcome.value
    solved = "solved on one mesh, " if last.state is State.SOLVED else ""
    return f"{name}: {last.stage.value}, {race_time}, {solved}{'' if is_certified(results) else 'not '}certified"


def run_page(race: Race, name: str, results: Sequence[StageResult]) -> str:
    """Return the stages, the gate splits of the last one, and its flight from above, as HTML."""
    title = f"{race.course.name}, flown by {race.aircraft.name}"
    stages = Table(title, STAGES, [_stage_cells(result) for result in results]).html()
    sentence = verdict(results)[1] if results else "no stage is finished yet"
    remark = f"<p>{escaped(sentence)}</p>" if sentence else ""
    return f"<div>{stages}{remark}{_flight(race, results[-1]) if results else ''}</div>"


def stage_page(race: Race, result: StageResult) -> str:
    """Return one stage as HTML: its gate splits, its flight from above, and its certificate."""
    certificate, measured = result.certificate, ""
    if certificate is not None:
        measured = certificate_table(certificate, f"certificate ({certificate.solver_status})").html()
    return f"<div><p><b>{escaped(run_line(race.course.name, [result]))}</b></p>{_flight(race, result)}{measured}</div>"


def _stage_cells(result: StageResult) -> tuple[str | float, ...]:
    race_time = result.trajectory.race_time if result.is_flight else result.outcome.value
    return result.stage.value, race_time, result.state.value, result.iterations, result.timings.wall


def _flight(race: Race, result: StageResult) -> str:
    """Return splits and picture as HTML; empty if no flight was found."""
    if not result.is_flight:
        return ""
    return f"{Splits(result.splits).to_html()}{plan_svg(map_model(race), result.trajectory)}"
