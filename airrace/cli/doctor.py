"""The command `airrace doctor`: whether this installation works."""

from airrace.cli.answer import answering
from airrace.cli.options import AsJson, Verbose


def doctor(as_json: AsJson = False, verbose: Verbose = False) -> None:
    """Examine this installation.

    It tells the versions, what is missing for which command, and whether a problem with a known answer is solved.
    """
    with answering({"healthy": False, "components": []}, as_json=as_json, verbose=verbose) as answer:
        from dataclasses import asdict

        from airrace.cli.installation import examined
        from airrace.runs.command_result import ExitCode

        components = examined()
        width = max(len(one.name) for one in components)
        lines = [
            f"{one.name:<{width}}  {one.fault or one.found or f'missing, needed for {one.needed_for}'}"
            for one in components
        ]
        answer.texts.append("\n".join(lines))
        faulty = [one.name for one in components if one.fault]
        answer.fields.update(healthy=not faulty, components=[asdict(one) for one in components])
        if faulty:
            answer.fail(ExitCode.BUG, f"this installation does not work: {', '.join(faulty)}")
