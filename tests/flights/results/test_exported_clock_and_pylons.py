"""Exports keep the date and the clock of a recording, and show pylons as high as they are."""

import json
import re
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from example_flights import circling, rovinj

from airrace.files.export.formats import formats
from airrace.files.export.globe import BEGIN, clock_start, on_globe
from airrace.flights.results import Flight
from airrace.model.track.element import PYLON_HEIGHT


def flight() -> Flight:
    return on_globe(circling(rovinj(), label="one"), None).at_rate(20.0)


@pytest.mark.parametrize("name", ["kml", "acmi", "fdr", "czml", "gpx", "geojson", "netcdf"])
def test_the_clock_of_a_recording_is_that_of_its_exports(name: str) -> None:
    begins = datetime(2014, 4, 13, 13, 59, 58, 120_000, UTC)
    plain = flight()
    dated = replace(plain, source=replace(plain.source, begins=begins))
    assert clock_start([plain]) == BEGIN
    assert clock_start([plain, dated]) == begins
    text = formats()[name].write([dated], clock_start([dated])).decode("latin-1")
    assert "2000" not in re.findall(r"\b(\d{4})[-/]\d\d[-/]\d\d\b|\d\d/\d\d/(\d{4})", text)
    if name == "acmi":
        assert "0,ReferenceTime=2014-04-13T13:59:58Z" in text
        assert "\n#0.120\n" in text
    elif name == "fdr":
        assert "DATE, 04/13/2014" in text
        assert "\n13:59:58.120, " in text
    else:
        assert re.search(r"2014-04-13[T ]13:59:58\.120", text)


def test_pylons_are_as_high_as_those_of_air_races() -> None:
    """A gate is a wall from pylon to pylon, a pylon alone stands by itself."""
    flights = [flight()]
    top = flights[0].course.origin.elevation + PYLON_HEIGHT
    packets = {packet.get("name"): packet for packet in json.loads(formats()["czml"].write(flights, BEGIN))}
    gates = [packet["wall"] for name, packet in packets.items() if name and name.startswith("gate ")]
    assert gates
    assert {up for wall in gates for up in wall["positions"]["cartographicDegrees"][2::3]} == {top}
    pylons = [packet["cylinder"]["length"] for name, packet in packets.items() if name and name.startswith("pylon ")]
    assert set(pylons) <= {PYLON_HEIGHT}
    places = [line for line in formats()["acmi"].write(flights, BEGIN).decode().splitlines() if "Name=gate " in line]
    assert places
    assert all(line.endswith(f",Height={PYLON_HEIGHT:g}") for line in places)
