"""The builder of the passages: from the `course` of a track file to every passage in the order flown."""

from collections import Counter
from collections.abc import Iterator

from airrace.inputs.features import Feature, Step
from airrace.inputs.nodes import KeyPath, Reporter
from airrace.inputs.surroundings import room_beside
from airrace.inputs.track_schema import PASSAGES_MAX, CourseEntry, FlownEntry
from airrace.quantities import Interval
from airrace.records import record
from airrace.track.course import Direction, Passage
from airrace.track.limits import SafetyLine


@record
class Mention:
    """A passing as the file asks for it; `path` and `direction_path` are where it does. The start has lap 0."""

    path: KeyPath
    direction_path: KeyPath
    lap: int
    gate: str
    direction: str | None
    safety_lines: tuple[str, ...] = ()


def build_passages(
    entry: CourseEntry,
    features: dict[str, Feature],
    lines: dict[str, SafetyLine],
    start_speed: Interval,
    reporter: Reporter,
) -> tuple[Passage, ...]:
    """Return every passage; they are only of use if nothing was reported. Names that do not exist are passed over."""
    if not _check_laps(entry, reporter):
        return ()
    passages: list[Passage] = []
    seen: Counter[str] = Counter()
    checked: set[tuple[KeyPath, str]] = set()  # a remark on a repeated lap is made once
    before: Feature | None = None
    for mention in _mentions(entry):
        feature = features.get(mention.gate)
        if feature is None:
            before = None
            continue
        held = tuple(lines[name] for name in mention.safety_lines if name in lines)
        if (mention.path, before.name if before else "") not in checked:
            checked.add((mention.path, before.name if before else ""))
            _check_mention(mention, feature, reporter)
            _check_sides(mention, [before, feature], held, reporter)
        speed = start_speed if mention.lap == 0 else Interval()
        passages.extend(_passage(mention, step, held, speed, seen) for step in feature.steps)
        before = feature
    return tuple(passages)


def _check_laps(entry: CourseEntry, reporter: Reporter) -> bool:
    """Return whether the course says its laps in one way, and not too many; report where it does not."""
    if entry.lap is None and entry.each_lap is None:
        reporter.key(
            ("course", "lap"),
            "missing; a course needs `lap`, the elements in the order flown, or `each_lap`, such an order per lap",
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


def _mentions(entry: CourseEntry) -> Iterator[Mention]:
    """Yield start, laps and finish in the order flown."""
    yield Mention(("course", "start"), ("course", "start_direction"), 0, entry.start, entry.start_direction)
    for lap in range(1, (entry.laps or 1) + 1):
        for index, item in enumerate(entry.lap or ()):
            yield _mention(("course", "lap", index), lap, item)
    for lap, items in enumerate(entry.each_lap or (), start=1):
        for index, item in enumerate(items):
            yield _mention(("course", "each_lap", lap - 1, index), lap, item)
    if entry.finish:
        yield _mention(("course", "finish"), len(entry.each_lap or ()) or entry.laps or 1, entry.finish)


def _mention(path: KeyPath, lap: int, item: FlownEntry) -> Mention:
    return Mention(path, (*path, "direction"), lap, item.gate, item.direction, tuple(item.safety_lines))


def _check_mention(mention: Mention, feature: Feature, reporter: Reporter) -> None:
    if mention.lap == 0 and len(feature.steps) > 1:
        reporter.value(mention.path, f"`{feature.name}` is flown as two passings; a race starts at one gate or pylon")
    elif mention.lap == 0 and feature.position is None:
        reporter.value(
            mention.path,
            f"a race must start somewhere: `{mention.gate}` needs north_m, east_m and height_m, or be a gate",
        )
    if mention.direction is not None and not feature.has_direction:
        reporter.value(
            mention.direction_path, f"only two-pylon gates have a direction; `{mention.gate}` is none, leave it out"
        )
    elif mention.direction == "planned" and not feature.free_directions:
        reporter.value(
            mention.direction_path,
            f"the passings of `{mention.gate}` depend on each other: forward or reverse; or give it `then: either`",
        )


def _check_sides(
    mention: Mention, ends: list[Feature | None], lines: tuple[SafetyLine, ...], reporter: Reporter
) -> None:
    """Report an end of a leg that does not stand on the allowed side of the lines that the leg names."""
    for index, line in enumerate(lines):
        for feature in ends:
            if feature is None or feature.position is None or line.start == line.end:
                continue
            room = room_beside(line, feature.position[0])
            if room < line.margin:
                side = "right" if line.keep_right else "left"
                margin = f" and {line.margin:g} m away" if line.margin else ""
                where = f"{-room:.4g} m beyond it" if room < 0.0 else f"{room:.4g} m from it"
                reporter.value(
                    (*mention.path, "safety_lines", index),
                    f"the leg to `{mention.gate}` must stay {side} of `{line.name}`{margin}, but `{feature.name}` "
                    f"stands {where}",
                )


def _passage(
    mention: Mention, step: Step, lines: tuple[SafetyLine, ...], speed: Interval, seen: Counter[str]
) -> Passage:
    name = f"{mention.lap}:{step.element.name}"
    seen[name] += 1
    return Passage(
        name=name if seen[name] == 1 else f"{name}#{seen[name]}",
        lap=max(mention.lap, 1),  # the start opens the first lap
        element=step.element,
        direction=step.direction or Direction(mention.direction or "forward"),
        speed=speed,
        safety_lines=lines,
        roll=step.roll,
    )
