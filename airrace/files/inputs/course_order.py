"""The order of a course: its keys, the names that stand there, and every passage of the race."""

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le
from pydantic import Field

from airrace.files.inputs.kinds.kind import CompositeElement
from airrace.files.inputs.nodes import (
    PASSAGES_MAX,
    SAFETY_LINES_MAX,
    KeyPath,
    MappingNode,
    Node,
    Reporter,
    ScalarNode,
    SequenceNode,
)
from airrace.files.inputs.schema import Schema, ShorthandSchema, optional
from airrace.model.track.course import Direction, Passage, SafetyLine
from airrace.optimal_control.quantities import Interval

DirectionName = Literal["forward", "reverse", "planned"]
EndStateName = Literal["settled", "free"]


class PassingReferenceEntry(ShorthandSchema):
    """A passing: the name of an element, or a mapping that says more about it."""

    what: ClassVar[str] = "a passing"
    form: ClassVar[str] = "the name of a gate or {gate: NAME, direction: reverse}"
    shorthand: ClassVar[str | None] = "gate"
    gate: str = Field(description="the name of an element of `gates`")
    direction: DirectionName | None = optional(
        "which way a two-pylon gate is passed; `planned`: whichever makes the shorter race"
    )
    safety_lines: Annotated[list[str], Field(max_length=SAFETY_LINES_MAX)] = Field(
        default_factory=list[str],
        description="names of `safety_lines` not to be crossed on the leg that leads here; one that no passing names "
        "is not to be crossed on any leg",
    )


Lap = Annotated[list[PassingReferenceEntry], Field(min_length=1, max_length=PASSAGES_MAX)]


class CourseEntry(Schema):
    """The order of a race: either `lap`, repeated `laps` times, or `each_lap`."""

    what: ClassVar[str] = "a course"
    start: str = Field(description="the element that starts the clock")
    start_direction: DirectionName | None = optional("which way the start is passed")
    start_state: EndStateName = Field(
        default="settled",
        description="how the aircraft flies when the clock starts: `settled`, as in a steady flight with the load "
        "factor and the roll rate of that instant, or `free`, in any way within the limits",
    )
    lap: Lap | None = optional("the elements in race order")
    laps: Annotated[int, Ge(1), Le(100)] | None = optional("the number of laps; 1 by default")
    each_lap: Annotated[list[Lap], Field(min_length=1, max_length=100)] | None = optional(
        "instead of `lap` and `laps`: an order of its own for every lap"
    )
    finish: PassingReferenceEntry | None = optional(
        "the element that stops the clock, if it is not the last of the last lap"
    )
    finish_state: EndStateName = Field(
        default="free", description="how the aircraft flies when the clock stops, likewise"
    )


@dataclasses.dataclass(frozen=True)
class CourseReference:
    """A passing as it stands at a path of the file, as far as it can be read; the start has lap 0.

    Attributes:
        safety_lines: names, each with its index in the file's list.
    """

    path: KeyPath
    lap: int
    gate: str | None
    direction: str | None = None
    safety_lines: tuple[tuple[int, str], ...] = ()

    @property
    def direction_path(self) -> KeyPath:
        return (*self.path, "direction") if self.lap else ("course", "start_direction")


def references_of(course: MappingNode) -> list[CourseReference]:
    """Return all passings in race order; those of a repeated lap once."""
    start = _reference(course.get("start"), ("course", "start"), 0)
    references = [dataclasses.replace(start, direction=_text(course.scalar("start_direction")))]
    for index, node in enumerate(_items(course.get("lap"))):
        references.append(_reference(node, ("course", "lap", index), 1))
    for lap, items in enumerate(_items(course.get("each_lap"))):
        for index, node in enumerate(_items(items)):
            references.append(_reference(node, ("course", "each_lap", lap, index), lap + 1))
    if "finish" in course.entries:
        laps = len(_items(course.get("each_lap"))) or course.scalar("laps")
        references.append(_reference(course.get("finish"), ("course", "finish"), laps if isinstance(laps, int) else 1))
    return references


def _reference(node: Node | None, path: KeyPath, lap: int) -> CourseReference:
    match node:
        case ScalarNode(value=str(gate)):
            return CourseReference(path, lap, gate)
        case MappingNode():
            lines: list[tuple[int, str]] = []
            for index, item in enumerate(_items(node.get("safety_lines"))):
                if isinstance(item, ScalarNode) and isinstance(item.value, str):
                    lines.append((index, item.value))
            gate, direction = _text(node.scalar("gate")), _text(node.scalar("direction"))
            return CourseReference(path, lap, gate, direction, tuple(lines))
        case _:
            return CourseReference(path, lap, None)


def _items(node: Node | None) -> Sequence[Node]:
    return node.items if isinstance(node, SequenceNode) else ()


def _text(value: object) -> str | None:
    return value if isinstance(value, str) else None


def check_references(reporter: Reporter) -> None:
    """Report names of gates and safety lines that do not exist, and gates passed twice in a row.

    The check works on the tree, so that it does not depend on the rest of the document being valid.
    """
    course, gates = reporter.find(("course",)), reporter.find(("gates",))
    if not isinstance(course, MappingNode):
        return
    references = references_of(course)
    if len(references) > PASSAGES_MAX:
        return  # the schema reports that, and nothing else matters then
    if isinstance(gates, MappingNode):
        for reference in references:
            if reference.gate is not None and reference.gate not in gates.entries:
                hint = reporter.suggestion(reference.gate, gates.entries.keys())
                reporter.value(reference.path, f"unknown gate `{reference.gate}`{hint}")
        _check_neighbours(references, course, gates, reporter)
    if any(isinstance(course.get(key), SequenceNode) for key in ("lap", "each_lap")):
        _check_lines(references, reporter)


def _check_neighbours(
    references: Sequence[CourseReference], course: MappingNode, gates: MappingNode, reporter: Reporter
) -> None:
    has_laps = any(len(reference.path) > 2 for reference in references)
    pairs = list(pairwise(references)) if has_laps else []
    laps = course.scalar("laps")
    lap = _of_lap(references)
    if lap and isinstance(laps, int) and laps > 1:
        pairs.append((lap[-1], lap[0]))
    repeated = {after.path: after.gate for before, after in pairs if before.gate == after.gate}
    for path, gate in repeated.items():
        if gate in gates.entries:
            reporter.value(path, f"`{gate}` is passed twice in a row; another element must come between")


def _of_lap(references: Sequence[CourseReference]) -> list[CourseReference]:
    """Return the passings of the lap that is repeated."""
    return [reference for reference in references if reference.path[:2] == ("course", "lap")]


def _check_lines(references: Sequence[CourseReference], reporter: Reporter) -> None:
    lines = reporter.find(("safety_lines",))
    names = list(lines.entries) if isinstance(lines, MappingNode) else []
    for reference in references:
        for index, name in reference.safety_lines:
            if name not in names:
                hint = reporter.suggestion(name, names) or "; there are none in `safety_lines`"
                reporter.value((*reference.path, "safety_lines", index), f"unknown safety line `{name}`{hint}")


def build_passages(
    entry: CourseEntry,
    elements: Mapping[str, CompositeElement],
    lines: Mapping[str, SafetyLine],
    start_speed: Interval,
    reporter: Reporter,
) -> tuple[Passage, ...]:
    """Return every passage; valid only if nothing was reported. Unknown names are skipped.

    A safety line that no passing names holds on all legs.
    """
    course = reporter.find(("course",))
    if not _check_laps(entry, reporter) or not isinstance(course, MappingNode):
        return ()
    references = references_of(course)
    on_some_legs = {name for reference in references for _, name in reference.safety_lines}
    everywhere = tuple(line for name, line in lines.items() if name not in on_some_legs)
    passages: list[Passage] = []
    seen: Counter[str] = Counter()
    checked: set[tuple[KeyPath, str]] = set()  # a remark on a repeated lap is made once
    before: CompositeElement | None = None
    for reference in _flight(references, entry.laps or 1):
        element = elements.get(reference.gate or "")
        if element is None:
            before = None
            continue
        own = tuple(lines[name] for _, name in reference.safety_lines if name in lines)
        sides_to_keep = (*everywhere, *own) if reference.lap else own
        if (reference.path, before.name if before else "") not in checked:
            checked.add((reference.path, before.name if before else ""))
            _check_reference(reference, element, reporter)
            _check_sides(reference, [before, element], own, reporter)
        for part in element.parts:
            name = f"{reference.lap}:{part.element.name}"
            seen[name] += 1
            passages.append(
                Passage(
                    name=name if seen[name] == 1 else f"{name}#{seen[name]}",
                    lap=max(reference.lap, 1),  # the start opens the first lap
                    element=part.element,
                    direction=part.direction or Direction(reference.direction or "forward"),
                    speed=start_speed if reference.lap == 0 else Interval(),
                    safety_lines=sides_to_keep,
                    roll=part.roll,
                )
            )
        before = element
    passed = [elements[reference.gate] for reference in references if reference.gate and reference.gate in elements]
    _check_everywhere(everywhere, passed, reporter)
    return tuple(passages)


def _flight(references: Sequence[CourseReference], laps: int) -> Iterator[CourseReference]:
    """Yield the passings with those of a repeated lap as often as there are laps."""
    lap = _of_lap(references)
    yield references[0]
    for number in range(1, laps + 1):
        for reference in lap:
            yield dataclasses.replace(reference, lap=number)
    yield from references[1 + len(lap) :]


def _check_laps(entry: CourseEntry, reporter: Reporter) -> bool:
    """Return whether the course gives its laps in one way, and not too many; report if not."""
    if entry.lap is None and entry.each_lap is None:
        reporter.key(
            ("course", "lap"),
            "missing; a course needs `lap`, the elements in race order, or `each_lap`, such an order per lap",
        )
        return False
    if entry.each_lap is not None:
        for key in ("lap", "laps"):
            if getattr(entry, key) is not None:
                reporter.key(("course", key), "not together with `each_lap`, which says every lap by itself")
                return False
    laps = entry.laps or 1
    total = laps * len(entry.lap or ()) + sum(len(lap) for lap in entry.each_lap or ())
    if total > PASSAGES_MAX:
        path = ("course", "laps" if laps > 1 else "lap" if entry.lap else "each_lap")
        reporter.value(path, f"{total} passings are too many; at most {PASSAGES_MAX}")
    return total <= PASSAGES_MAX


def _check_reference(reference: CourseReference, element: CompositeElement, reporter: Reporter) -> None:
    gate, first = reference.gate, element.parts[0].element
    if reference.lap == 0 and len(element.parts) > 1:
        reporter.value(reference.path, f"`{gate}` is two passings; a race starts at one gate or pylon")
    elif reference.lap == 0 and element.position is None:
        message = f"a race must start somewhere: `{gate}` needs north_m, east_m and height_m, or be a gate"
        reporter.value(reference.path, message)
    if reference.direction is not None and not first.directed:
        message = f"only two-pylon gates have a direction; `{gate}` is none, leave it out"
        reporter.value(reference.direction_path, message)
    elif reference.direction == "planned" and not element.free_directions:
        message = f"the passings of `{gate}` depend on each other: forward or reverse; or give it `then: either`"
        reporter.value(reference.direction_path, message)


def _check_everywhere(lines: Sequence[SafetyLine], passed: Sequence[CompositeElement], reporter: Reporter) -> None:
    """Report an element that does not stand on the allowed side of a line that holds on all legs."""
    for line in lines:
        for element in passed:
            where = _where_beyond(line, element)
            if where:
                reporter.key(
                    ("safety_lines", line.name),
                    f"no passing names this line, so it holds on all legs, but `{element.name}` stands {where}; name "
                    "it in the `safety_lines` of the passings to which the legs lead on which it holds",
                )
                break


def _where_beyond(line: SafetyLine, element: CompositeElement) -> str:
    """Return in words where an element stands that is beyond a line or within its margin; else nothing."""
    if element.position is None or line.start == line.end:
        return ""
    distance = line.room(element.position[0])
    if not distance < line.margin:
        return ""
    return f"{-distance:.4g} m beyond it" if distance < 0.0 else f"{distance:.4g} m from it"


def _check_sides(
    reference: CourseReference,
    ends: Sequence[CompositeElement | None],
    lines: Sequence[SafetyLine],
    reporter: Reporter,
) -> None:
    """Report an end of a leg that does not stand on the allowed side of the lines that the leg names."""
    for index, line in enumerate(lines):
        for element in ends:
            where = _where_beyond(line, element) if element is not None else ""
            if element is not None and where:
                side = "right" if line.keep_right else "left"
                margin = f" and {line.margin:g} m away" if line.margin else ""
                reporter.value(
                    (*reference.path, "safety_lines", index),
                    f"the leg to `{reference.gate}` must stay {side} of `{line.name}`{margin}, but `{element.name}` "
                    f"stands {where}",
                )
