"""Names in exported flights are texts for whoever opens them: no HTML, no formulas of spreadsheets."""

import csv
import io
import json
from dataclasses import replace

import pytest
from example_flights import circling, rovinj

from airrace.files.export.csv import export_flight_csv
from airrace.files.export.czml import czml
from airrace.files.export.globe import BEGIN, on_globe


def test_descriptions_that_viewers_take_for_html_are_escaped() -> None:
    one = on_globe(circling(rovinj()), None)
    one = replace(one, race=replace(one.race, aircraft=replace(one.race.aircraft, name="<img src=x onerror=hack()>")))
    descriptions = [packet.get("description", "") for packet in json.loads(czml([one], BEGIN))]
    assert any("&lt;img src=x onerror=hack()&gt;" in text for text in descriptions)
    assert not any("<" in text for text in descriptions)


@pytest.mark.parametrize("name", ['=HYPERLINK("http://a.b")', "+1+1", "-2+3", "@SUM(1)", "::error::x", "\t=1"])
def test_no_cell_of_a_flight_is_a_formula_and_numbers_stay_numbers(name: str) -> None:
    one = on_globe(circling(rovinj()), None)
    first, *others = one.crossings
    first = replace(first, passage=replace(first.passage, name=name))
    stream = io.StringIO(newline="")
    export_flight_csv(replace(one, crossings=(first, *others)), stream)
    head, *rows = csv.reader(line for line in stream.getvalue().splitlines() if not line.startswith("#"))
    assert rows[0][-1] == f"'{name}"
    assert not any(row[-1].startswith(("=", "+", "-", "@", "::", "\t")) for row in rows)
    numbers = [[float(cell) for cell in row[:-1]] for row in rows]
    assert min(value for row in numbers for value in row) < 0.0
    assert len(head) == len(rows[0])
