"""The verdict on a run: how far it has come, whether it is certified, and the exit code that its stages deserve."""

from collections.abc import Sequence
from dataclasses import replace

from airrace.procedure.result import StageResult, Status
from airrace.runs.command_result import ExitCode, worst

_CODES = {
    Status.SOLVED: ExitCode.DONE,
    Status.NOT_CERTIFIED: ExitCode.NOT_CERTIFIED,
    Status.NOT_CONVERGED: ExitCode.NOT_CERTIFIED,
    Status.INFEASIBLE: ExitCode.INFEASIBLE,
    Status.TIMEOUT: ExitCode.TIMEOUT,
}


def verdict(results: Sequence[StageResult], *, stopped: bool = False) -> tuple[ExitCode, str]:
    """Return how stages end a run: the gravest of their codes, and the sentence of the first stage that has it.

    Of a run that was stopped none is the last.
    """
    codes = _codes(results, stopped=stopped)
    code = worst(codes)
    if code is ExitCode.DONE:
        return code, ""
    result = results[codes.index(code)]
    return code, f"{result.stage.value}: {_verdict(result)}"


def is_certified(results: Sequence[StageResult]) -> bool:
    """Tell whether a run may call itself certified: its last stage is, and none before it failed.

    Stages before it may be merely solved on one mesh.
    """
    return bool(results) and worst(_codes(results)) is ExitCode.DONE


def downgrade_stale(result: StageResult, stale: str, refutation: str = "") -> StageResult:
    """Return a stage as it may be reported: one that no longer stands, or is refuted, is not certified, and says why.

    Args:
        result: as stored.
        stale: why it no longer stands, a clause; empty where it does.
        refutation: why its verification failed, likewise.
    """
    if not stale and not refutation:
        return result
    standing = f"it no longer stands: {stale}" if stale else ""
    message = "; ".join(text for text in (standing, refutation, result.message) if text)
    outcome = Status.NOT_CERTIFIED if result.outcome is Status.SOLVED else result.outcome
    return replace(result, outcome=outcome, message=message)


def one_mesh_note(result: StageResult) -> str:
    """Return the sentence on a stage that was solved on one mesh where a certified one was wanted."""
    return result.remarks or "it is solved, but its race time was not confirmed on a second mesh"


def _codes(results: Sequence[StageResult], *, stopped: bool = False) -> list[ExitCode]:
    return [_code(result, last=result is results[-1] and not stopped) for result in results]


def _code(result: StageResult, *, last: bool) -> ExitCode:
    """Return the exit code that a stage deserves.

    A stage that is a mere guess by design, or was solved on one mesh, is no failure, unless the run ends with it.
    """
    if result.outcome is not Status.SOLVED:
        return _CODES[result.outcome]
    if result.certificate is None:
        return ExitCode.NOT_CERTIFIED if last else ExitCode.DONE
    return ExitCode.DONE if result.certified or (result.holds and not last) else ExitCode.NOT_CERTIFIED


def _verdict(result: StageResult) -> str:
    if result.outcome is not Status.SOLVED:
        return result.remarks or result.outcome.value
    if result.certificate is None:
        return "the run ends with a guess, which is not certified"
    if result.status is Status.SOLVED:
        return one_mesh_note(result)
    failed = ", ".join(item.name for item in result.certificate.failed)
    return f"not certified: {failed or 'nothing was measured'}"


def run_line(name: str, results: Sequence[StageResult]) -> str:
    """Return a line that says which run it is, how far it has come and whether it is certified."""
    if not results:
        return f"{name}: no stage is finished yet"
    last = results[-1]
    race_time = f"{last.trajectory.race_time:.3f} s" if last.has_race_time else last.status.value
    prefix = "solved on one mesh, " if last.status is Status.SOLVED else ""
    return f"{name}: {last.stage.value}, {race_time}, {prefix}{'' if is_certified(results) else 'not '}certified"
