"""`airrace check`: validate the inputs and print the course."""

from airrace.cli.answer import answering
from airrace.cli.options import AircraftFile, AsJson, Overrides, SettingsFile, TrackFile


def check(
    track: TrackFile,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Validate inputs and print the course."""
    with answering({"track": track.stem, "valid": False}, as_json=as_json) as answer:
        from airrace.cli.course import course_object, course_tables
        from airrace.cli.tables import rendered
        from airrace.documents import load_inputs

        inputs = load_inputs(track, aircraft=aircraft, settings=settings, overrides=overrides or ())
        answer.fields.update(valid=True, **course_object(inputs.race))
        answer.texts.extend(rendered(table) for table in course_tables(inputs.race))
