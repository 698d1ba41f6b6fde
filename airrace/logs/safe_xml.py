"""XML of strangers as a tree: without document types, and so without entities that could grow beyond all memory."""

from collections.abc import Mapping
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from airrace.logs.recording import refuse


def xml_tree(path: str, content: bytes) -> Element:
    """Return the root of a document; elements are named without their namespaces.

    Args:
        path: of the file, for messages.
        content: of the file.

    Raises:
        InputError: it is no XML, or holds a document type.
    """
    builder, parser = TreeBuilder(), expat.ParserCreate(namespace_separator=" ")

    def begin(name: str, attributes: Mapping[str, str]) -> None:
        builder.start(name.rpartition(" ")[2], dict(attributes))

    def end(name: str) -> None:
        builder.end(name.rpartition(" ")[2])

    def doctype(*_: object) -> None:
        refuse(path, parser.CurrentLineNumber, "holds a document type; such a file needs none")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        refuse(path, error.lineno, f"is no XML: {expat.ErrorString(error.code)}")
    return builder.close()
