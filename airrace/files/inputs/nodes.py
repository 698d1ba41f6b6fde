"""The tree of a YAML text between reader and schemas, in which every key and value keeps its place in the file."""

import difflib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from airrace.errors import Finding

# The largest documents that are read; the largest real course needs a hundredth of it.
SIZE_MAX = 2 * 1024 * 1024
"""The size of a file, bytes, and of a text, characters."""
DEPTH_MAX = 32
"""Lists and mappings within one another."""
VALUES_MAX = 200_000
"""Values in a document; ten thousand gates, each with ten keys, have half of them."""
KEY_LENGTH_MAX = 100
REREAD_MAX = 65_536
"""Characters up to which invalid YAML is parsed again by PyYAML's own parser, whose messages are clearer."""
FINDINGS_MAX = 100
"""Findings that are reported for one document."""
QUOTE_MAX = 100
"""Characters of a quoted word in a message."""
NAMES_MAX = 20
"""Names that are listed where none is similar."""
COMPARISONS_MAX = 50_000
"""Comparisons of names for one document, about a second's work."""
GATES_MAX = PASSAGES_MAX = 10_000
CROWDS_MAX = 20
OBSTACLES_MAX = 50
CORNERS_MAX = 50
"""Corners of one area."""
SAFETY_LINES_MAX = THERMALS_MAX = 100
PLACEMARKS_MAX = 1000
"""Placemarks of which a course is sketched."""

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
    return ".".join(map(str, path))


def most_similar(word: str, names: Collection[str]) -> str:
    """Return the name that a misspelt word may stand for; empty if none is similar."""
    return next(iter(difflib.get_close_matches(word[:100], names, n=1)), "")


@dataclass
class Reporter:
    """Collects findings about entries of one document, each with its place in the file.

    Attributes:
        root: the document.
        findings: the findings of all documents.
        prefix: of keys on the command line ("settings."), added to those that come from there.
        other_prefixes: those of the other documents, if this one has none.
    """

    root: MappingNode
    findings: list[Finding]
    prefix: str = ""
    other_prefixes: tuple[str, ...] = ()
    _comparisons: int = 0

    def value(self, path: KeyPath, message: str) -> None:
        """Report a value; where the entry is absent, the innermost element that should hold it."""
        self._add(self._place(path, at_key=False), path, message)

    def key(self, path: KeyPath, message: str) -> None:
        """Report a key, also an absent one."""
        self._add(self._place(path, at_key=True), path, message)

    def suggestion(self, word: str, names: Collection[str]) -> str:
        """Return `; did you mean ...?` or `; known here: ...`, to be appended to a message.

        It is empty without names, and after thousands of names of one document.
        """
        self._comparisons += len(names)
        if not names or self._comparisons > COMPARISONS_MAX:
            return ""
        if similar := most_similar(word, names):
            return f"; did you mean `{similar}`?"
        first = list(names)[:NAMES_MAX]
        more = f" and {len(names) - len(first)} more" if len(names) > len(first) else ""
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
