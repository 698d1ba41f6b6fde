"""The tree of a YAML text between reader and schemas, in which every key and value keeps its place."""

import difflib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from airrace.errors import Finding


@dataclass(frozen=True)
class DocumentLimits:
    """The largest documents that are read; the largest real course needs a hundredth of it.

    Attributes:
        size: of a file, bytes, and of a text, characters.
        depth: of lists and mappings within one another.
        values: in a document; ten thousand gates, each with ten keys, have half of them.
        key: characters of a key.
        reread: characters up to which a text that is no YAML is read again by PyYAML's own parser, whose messages are
            the clearer ones.
        findings: that are reported for one document.
        quote: characters of a quoted word in a message.
        names: that are listed where none is similar.
        comparisons: of names for one document, about a second's work.
        gates, passages, crowds, obstacles, corners, safety_lines, thermals: of a course, the corners of one area.
        placemarks: of which a course is sketched.
    """

    size: int = 2 * 1024 * 1024
    depth: int = 32
    values: int = 200_000
    key: int = 100
    reread: int = 65_536
    findings: int = 100
    quote: int = 100
    names: int = 20
    comparisons: int = 50_000
    gates: int = 10_000
    passages: int = 10_000
    crowds: int = 20
    obstacles: int = 50
    corners: int = 50
    safety_lines: int = 100
    thermals: int = 100
    placemarks: int = 1000


LIMITS = DocumentLimits()

ScalarValue = str | int | float | bool | None
JSON = ScalarValue | list["JSON"] | dict[str, "JSON"]
KeyPath = tuple[str | int, ...]


@dataclass(frozen=True)
class Place:
    """A place in a file; `line` and `column` count from 1, and both are 0 outside of a file."""

    file: str
    line: int
    column: int


@dataclass(frozen=True)
class ScalarNode:
    """A single value."""

    place: Place
    value: ScalarValue

    def plain(self) -> JSON:
        return self.value


@dataclass(frozen=True)
class SequenceNode:
    """A list."""

    place: Place
    items: tuple["Node", ...] = ()

    def plain(self) -> JSON:
        return [item.plain() for item in self.items]


@dataclass(frozen=True)
class MappingEntry:
    """A key of a mapping with its value."""

    key_place: Place
    value: "Node"


@dataclass(frozen=True)
class MappingNode:
    """A mapping: keys and values in the order of the file."""

    place: Place
    entries: Mapping[str, MappingEntry] = field(default_factory=dict[str, MappingEntry])

    def plain(self) -> JSON:
        return {key: entry.value.plain() for key, entry in self.entries.items()}

    def get(self, key: str) -> "Node | None":
        """Return what stands at a key; None if it is absent."""
        entry = self.entries.get(key)
        return entry.value if entry else None

    def scalar(self, key: str) -> ScalarValue:
        """Return the value of a key; None if it is absent or no single value."""
        node = self.get(key)
        return node.value if isinstance(node, ScalarNode) else None


Node = ScalarNode | SequenceNode | MappingNode


def dotted(path: KeyPath) -> str:
    """Return a path of keys as messages name it, e.g. `gates.g4.heading_deg`; items of lists count from 0."""
    return ".".join(str(part) for part in path)


@dataclass
class Reporter:
    """A reporter that turns remarks about entries of one document into findings with their place.

    Attributes:
        root: the document.
        findings: where the findings are gathered.
        prefix: what the keys begin with on the command line ("settings."); added where the value came from there.
        others: prefixes of the other documents, where keys without one belong to this.
    """

    root: MappingNode
    findings: list[Finding]
    prefix: str = ""
    others: tuple[str, ...] = ()
    _comparisons: int = 0

    def value(self, path: KeyPath, message: str) -> None:
        """Remark on a value; where the entry is absent, on the innermost element that should hold it."""
        self._add(self._place(path, at_key=False), path, message)

    def key(self, path: KeyPath, message: str) -> None:
        """Remark on the key itself, or on an absent one."""
        self._add(self._place(path, at_key=True), path, message)

    def suggestion(self, word: str, known: Collection[str]) -> str:
        """Return `; did you mean ...?` or `; known here: ...`, to be appended to a message.

        It is empty where nothing is known, and after thousands of names of one document.
        """
        self._comparisons += len(known)
        if not known or self._comparisons > LIMITS.comparisons:
            return ""
        if similar := difflib.get_close_matches(word[:100], known, n=1):
            return f"; did you mean `{similar[0]}`?"
        first = list(known)[: LIMITS.names]
        more = f" and {len(known) - len(first)} more" if len(known) > len(first) else ""
        return f"; known here: {', '.join(first)}{more}"

    def is_set(self, path: KeyPath) -> bool:
        """Return whether a key was given on the command line and not in the file."""
        return not self._place(path, at_key=True).line

    def find(self, path: KeyPath) -> Node | None:
        """Return the node at a path, or None if there is none."""
        node: Node | None = self.root
        for part in path:
            step = child(node, part) if node else None
            node = step.value if step else None
        return node

    def _add(self, place: Place, path: KeyPath, message: str) -> None:
        prefix = "" if place.line else self.prefix
        self.findings.append(Finding(place.file, place.line, place.column, prefix + dotted(path), message))

    def _place(self, path: KeyPath, *, at_key: bool) -> Place:
        place: Place = self.root.place
        node: Node = self.root
        for index, part in enumerate(path):
            step = child(node, part)
            if step is None:  # or it is what a shorthand stands for
                return node.place if isinstance(node, ScalarNode) else place
            is_last = index == len(path) - 1
            # What an element lacks is reported at its key.
            place = step.value.place if is_last and not at_key else step.key_place
            node = step.value
        return place


def child(node: Node, part: str | int) -> MappingEntry | None:
    """Return the entry one step down: an entry of a mapping, or an item of a list.

    The place of an item serves as that of its key. None stands for an entry that does not exist.
    """
    if isinstance(node, MappingNode) and isinstance(part, str):
        return node.entries.get(part)
    if isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.items):
        return MappingEntry(node.items[part].place, node.items[part])
    return None
