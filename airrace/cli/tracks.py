"""The command `airrace tracks`: the courses and aircraft that come along."""

from airrace.cli.answer import answering
from airrace.cli.options import AsJson, Verbose


def tracks(as_json: AsJson = False, verbose: Verbose = False) -> None:
    """List the courses, aircraft and rule books that come along.

    Their names stand for files in every command, and in track files.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from textwrap import fill

        from airrace.cli.tables import plain_table, rendered
        from airrace.runs.courses import shipped

        listed = shipped()
        answer.fields.update(listed.as_object())
        courses = [(one.name, one.title, one.aircraft, str(one.laps), str(one.passages)) for one in listed.tracks]
        names, numbers = ("name", "course", "aircraft"), ("laps", "passings")
        answer.texts.append(rendered(plain_table("courses", names, numbers, courses)))
        aircraft = [(one.name, one.title) for one in listed.aircraft]
        answer.texts.append(rendered(plain_table("aircraft", ("name", "aircraft"), (), aircraft)))
        answer.texts.append(fill(f"rule books (rules: NAME): {', '.join(listed.rules)}", 80, break_on_hyphens=False))
