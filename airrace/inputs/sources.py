"""Where the numbers of a run come from, as its files say it."""

from airrace.inputs.inputs import DocumentReader, Inputs
from airrace.inputs.nodes import MappingNode
from airrace.inputs.objects import is_of_objects
from airrace.inputs.rules import read_preset

NOT_NAMED = "the file names none as a whole; see the comments beside its numbers"


def sources_of(inputs: Inputs) -> tuple[tuple[str, str, str], ...]:
    """Return what numbers are of, the schema of their file, and where they come from.

    They are those of the course, of the aircraft, and of the rules if these are a season's.
    """
    found: list[tuple[str, str, str]] = []
    reader = DocumentReader(inputs.overrides)
    for what, document in (("track", inputs.track), ("aircraft", inputs.aircraft)):
        opened = None if is_of_objects(document) else reader.open(document, what)
        if opened is None:
            found.append((what, "", "built in Python: no file says it"))
            continue
        root = opened.reporter.root
        source, rules = root.scalar("source"), root.get("rules")
        found.append((what, str(root.scalar("schema")), str(source) if source else NOT_NAMED))
        preset = rules.scalar("preset") if isinstance(rules, MappingNode) else root.scalar("rules")
        if preset:
            entry = read_preset(str(preset))
            found.append((f"rules {preset}", entry.schema_, entry.source))
    return tuple(found)
