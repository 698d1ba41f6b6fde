"""The gates of a track file that its course never passes."""

from airrace.inputs.features import base_name
from airrace.inputs.inputs import Inputs
from airrace.inputs.nodes import MappingNode
from airrace.inputs.objects import is_of_objects
from airrace.inputs.yaml_reader import read_yaml


def unused_gates(inputs: Inputs) -> list[str]:
    """Return the names of gates that stand in the track file and in no lap, in the order of the file.

    A course that was built in Python has none.
    """
    if is_of_objects(inputs.track):
        return []
    root = read_yaml(inputs.track.path, inputs.track.text)
    entry = root.entries.get("gates") if isinstance(root, MappingNode) else None
    names = list(entry.value.entries) if entry is not None and isinstance(entry.value, MappingNode) else []
    passed = {base_name(passage.element.name) for passage in inputs.race.course.passages}
    return [name for name in names if name not in passed]
