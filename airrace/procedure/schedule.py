"""The schedule of a run: which stages are solved, which are only checked, and which models are needed for that."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from airrace.procedure.result import StageResult
from airrace.procedure.settings import GuessKind, MeshCheck, Settings
from airrace.procedure.stage import STAGES, Stage


def stages_of_run(settings: Settings, until: Stage) -> list[Stage]:
    """Return the stages of a run from scratch; with a guess from the plan there is no homotopy."""
    first = STAGES.index(Stage.HOMOTOPY if settings.guess is GuessKind.HOMOTOPY else Stage.POINT_MASS)
    return list(STAGES[first : STAGES.index(until) + 1])


def checks_mesh(settings: Settings, stage: Stage, last: Stage | None) -> bool:
    """Tell whether a stage of a run up to `last` is checked on a second mesh; `last` is None where every stage is."""
    return settings.mesh_check is MeshCheck.ALL or last is None or stage is last


@dataclass(frozen=True)
class Schedule:
    """What a run still has to do.

    Attributes:
        mesh_checks: finished stages whose mesh is checked first, in order.
        stages: to be solved after that, in order.
        source: the stage of another run that is solved again before that; None where the run starts from scratch.
        models: the stages whose models are needed, in the order in which they are; some may stand there twice.
    """

    mesh_checks: Sequence[Stage]
    stages: Sequence[Stage]
    source: Stage | None
    models: Sequence[Stage]


def schedule(settings: Settings, until: Stage, finished: Mapping[Stage, StageResult], source: Stage | None) -> Schedule:
    """Return what is left of a run up to a stage.

    Args:
        settings: how the race is solved.
        until: the last stage.
        finished: stages that need not be run again, in order.
        source: the highest stage of another run to start from; None without one. Without effect where stages are
            finished.
    """
    # A run that was started from another one has no stages below its first: what is finished needs them no more.
    highest = max((STAGES.index(stage) for stage in finished), default=-1)
    stages = [stage for stage in stages_of_run(settings, until) if STAGES.index(stage) > highest]
    mesh_checks: list[Stage] = []
    for stage, result in finished.items():
        if result.holds and not result.certified and checks_mesh(settings, stage, until):
            mesh_checks.append(stage)
    if source is None or finished:
        # The last finished stage is where the next one starts from; the others only where a start fails.
        return Schedule(mesh_checks, stages, None, [*mesh_checks, *list(finished)[-1:], *stages, *finished])
    # From the highest stage of the other run; where that fails from its lower ones, and at last from scratch.
    above = STAGES[STAGES.index(source) : STAGES.index(until) + 1]
    return Schedule(mesh_checks, stages, source, [source, Stage.POINT_MASS, *above, *stages])
