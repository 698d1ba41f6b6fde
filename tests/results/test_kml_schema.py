"""KML documents are valid by the schemas that OGC and Google have published, which come with the package pykml."""

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest
from example_courses import everything, race
from example_flights import circling, half_cuban, rovinj
from lxml import etree

from airrace.export.globe import BEGIN, on_globe
from airrace.export.kml import kml
from airrace.results import Flight
from airrace.track.course import Origin

SOMEWHERE = Origin(0.8, 0.2, 500.0)
HOSTILE = '<script>alert(1)</script> ]]> & "quoted"\n\x00\u202e' + "x" * 10_000


@pytest.fixture(scope="module")
def schema() -> etree.XMLSchema:
    """The schema of Google's extension, which imports that of KML 2.2."""
    return etree.XMLSchema(etree.parse(str(files("pykml") / "schemas" / "kml22gx.xsd")))


def complaints(schema: etree.XMLSchema, content: bytes) -> list[str]:
    schema.validate(etree.fromstring(content))
    return [f"{one.line}: {one.message}" for one in schema.error_log]


def flights(folder: Path) -> list[Flight]:
    """Every kind of thing that a document may hold: all elements, people of all shapes, lines, an airspace, angles or
    none, names that XML cannot take as they are."""
    everywhere = on_globe(circling(race(everything(folder))), SOMEWHERE)
    histories = {name: one for name, one in everywhere.histories.items() if name not in ("psi", "theta", "phi")}
    return [
        on_globe(circling(rovinj(), label=HOSTILE), None),
        on_globe(half_cuban().flight(), SOMEWHERE),
        replace(everywhere, histories=histories),
    ]


def test_documents_are_valid(schema: etree.XMLSchema, tmp_path: Path) -> None:
    everyone = flights(tmp_path)
    for some in ([everyone[0]], [everyone[1]], [everyone[2]], everyone):
        assert complaints(schema, kml(some, BEGIN)) == []


def test_the_schema_refuses_a_track_whose_coordinates_come_before_its_times(
    schema: etree.XMLSchema, tmp_path: Path
) -> None:
    root = etree.fromstring(kml(flights(tmp_path)[:1], BEGIN))
    (track,) = root.iter("{http://www.google.com/kml/ext/2.2}Track")
    track.insert(1, track.find("{http://www.google.com/kml/ext/2.2}coord"))
    assert any("when" in one for one in complaints(schema, etree.tostring(root)))
