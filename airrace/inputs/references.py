"""The check whether a course names elements that exist.

It works on the tree alone, so that a fault elsewhere hides nothing.
"""

from collections.abc import Sequence
from itertools import pairwise

from airrace.inputs.nodes import KeyPath, MappingNode, Node, Reporter, ScalarNode, SequenceNode
from airrace.inputs.track_schema import PASSAGES_MAX
from airrace.records import record


@record
class _Named:
    """A name that stands in the course."""

    name: str
    path: KeyPath


@record
class _Mention:
    """A passing as far as it can be read; `gate` is None if it cannot."""

    path: KeyPath
    gate: str | None
    safety_lines: tuple[_Named, ...] = ()


def check_references(reporter: Reporter) -> None:
    """Report names of gates and safety lines that do not exist, gates passed twice in a row, lines without effect."""
    course = reporter.find(("course",))
    if not isinstance(course, MappingNode):
        return
    paths = _paths(course)
    if len(paths) > PASSAGES_MAX:
        return  # the schema reports that, and nothing else matters then
    mentions = [_mention(reporter.find(path), path) for path in paths]
    gates = reporter.find(("gates",))
    if isinstance(gates, MappingNode):
        for one in mentions:
            if one.gate is not None and one.gate not in gates.entries:
                reporter.value(
                    one.path, f"unknown gate `{one.gate}`{reporter.suggestion(one.gate, gates.entries.keys())}"
                )
        _check_neighbours(mentions, course, gates, reporter)
    if any(isinstance(_child(course, key), SequenceNode) for key in ("lap", "each_lap")):
        _check_lines([line for one in mentions for line in one.safety_lines], reporter)


def _paths(course: MappingNode) -> list[KeyPath]:
    """Return where passings stand, in the order flown; a lap that is repeated comes only once."""
    paths: list[KeyPath] = [("course", "start")]
    for index in range(_length(_child(course, "lap"))):
        paths.append(("course", "lap", index))
    laps = _child(course, "each_lap")
    for lap, node in enumerate(laps.items if isinstance(laps, SequenceNode) else ()):
        paths.extend(("course", "each_lap", lap, index) for index in range(_length(node)))
    if "finish" in course.entries:
        paths.append(("course", "finish"))
    return paths


def _mention(node: Node | None, path: KeyPath) -> _Mention:
    match node:
        case ScalarNode(value=str(gate)):
            return _Mention(path, gate)
        case MappingNode():
            gate = node.scalar("gate")
            lines = _child(node, "safety_lines")
            items = lines.items if isinstance(lines, SequenceNode) else ()
            named = tuple(
                _Named(item.value, (*path, "safety_lines", index))
                for index, item in enumerate(items)
                if isinstance(item, ScalarNode) and isinstance(item.value, str)
            )
            return _Mention(path, gate if isinstance(gate, str) else None, named)
        case _:
            return _Mention(path, None)


def _check_neighbours(
    mentions: Sequence[_Mention], course: MappingNode, gates: MappingNode, reporter: Reporter
) -> None:
    pairs = list(pairwise(mentions)) if any(len(one.path) > 2 for one in mentions) else []
    laps = course.scalar("laps")
    repeated = [one for one in mentions if one.path[:2] == ("course", "lap")]
    if repeated and isinstance(laps, int) and laps > 1:
        pairs.append((repeated[-1], repeated[0]))
    twice = {after.path: after.gate for before, after in pairs if before.gate == after.gate}
    for path, gate in twice.items():
        if gate in gates.entries:
            reporter.value(path, f"`{gate}` is passed twice in a row; another element must come between")


def _check_lines(named: Sequence[_Named], reporter: Reporter) -> None:
    lines = reporter.find(("safety_lines",))
    known = list(lines.entries) if isinstance(lines, MappingNode) else []
    for one in named:
        if one.name not in known:
            where = reporter.suggestion(one.name, known) or "; there are none in `safety_lines`"
            reporter.value(one.path, f"unknown safety line `{one.name}`{where}")
    used = {one.name for one in named}
    for name in known:
        if name not in used:
            reporter.key(
                ("safety_lines", name),
                "no passing names this line, so it is without effect; name it in the `safety_lines` of a passing",
            )


def _child(node: MappingNode, key: str) -> Node | None:
    entry = node.entries.get(key)
    return entry.value if entry else None


def _length(node: Node | None) -> int:
    return len(node.items) if isinstance(node, SequenceNode) else 0
