"""Documents of XML from unknown sources, read element by element."""

import codecs
import re
from collections.abc import Callable, Collection, Mapping
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from airrace.flights.logs.recording import DEPTH_MAX, refuse

_DECLARED = re.compile(rb"^<\?xml[^>]{0,200}?encoding=[\"']([A-Za-z0-9._-]{1,40})[\"']")
_MULTIBYTE = frozenset(
    ("shift_jis", "cp932", "euc_jp", "iso2022_jp", "gb2312", "gbk", "gb18030", "big5", "cp950", "euc_kr", "cp949")
)
"""Encodings of several bytes per letter, by the names of their codecs, which expat does not know."""


def xml_tree(path: str, content: bytes) -> Element:
    """Return the root of a document; elements are named without their namespaces.

    A document type is refused: its entities could grow beyond all memory.

    Args:
        path: of the file, for messages.
        content: of the file.

    Raises:
        InputError: it is no XML, or holds a document type.
    """
    try:
        root = parse_xml(path, content)
        assert root is not None  # all is read
        return root
    except expat.ExpatError as error:
        refuse(path, error.lineno, f"is no XML: {expat.ErrorString(error.code)}")


def _codec(name: str) -> str:
    try:
        return codecs.lookup(name).name
    except LookupError:
        return ""


def parse_xml(
    path: str,
    content: bytes,
    take: Callable[[Element, int], None] = lambda element, line: None,
    only: Collection[str] = (),
) -> Element | None:
    """Return the root of a document, as `xml_tree` does; raise an ExpatError where it is no XML.

    Every element is taken as it ends, with its first line. Where only elements of some names are to be read (`only`)
    with what they hold, all others are taken empty and there is no root, so the rest of the document needs no memory.
    """
    encoding = None
    if (declared := _DECLARED.match(content)) and (codec := _codec(declared[1].decode())) in _MULTIBYTE:
        content, encoding = content.decode(codec, "replace").encode(), "utf-8"
    builder, parser = TreeBuilder(), expat.ParserCreate(encoding, namespace_separator=" ")
    lines: list[int] = []  # the first ones of the elements that have begun
    inside = 0  # how many of them are read

    def begin(name: str, attributes: Mapping[str, str]) -> None:
        nonlocal inside
        tag = name.rpartition(" ")[2]
        lines.append(parser.CurrentLineNumber)
        if len(lines) > DEPTH_MAX:
            refuse(path, parser.CurrentLineNumber, f"holds elements within elements, more than {DEPTH_MAX} deep")
        if inside or not only or tag in only:
            inside += 1
            builder.start(tag, dict(attributes))

    def end(name: str) -> None:
        nonlocal builder, inside
        tag, line = name.rpartition(" ")[2], lines.pop()
        if not inside:
            take(Element(tag), line)
            return
        inside -= 1
        take(builder.end(tag), line)
        if only and not inside:
            builder = TreeBuilder()

    def data(text: str) -> None:
        if inside:
            builder.data(text)

    def doctype(*_: object) -> None:
        refuse(path, parser.CurrentLineNumber, "holds a document type; such a file needs none")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler = data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except (LookupError, ValueError):  # Python's codecs, of which expat takes those of a byte per letter
        refuse(path, 1, "declares an encoding that is not read; save it as UTF-8")
    return None if only else builder.close()
