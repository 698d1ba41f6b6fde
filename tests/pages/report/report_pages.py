"""Pages for tests, and what can be read out of them without a browser."""

import base64
import functools
import json
import math
from dataclasses import dataclass, field
from dataclasses import replace as with_
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
from example_courses import everything
from example_courses import race as race_of
from example_flights import circling, rovinj

from airrace.flights.results import Flight
from airrace.optimal_control.trajectory import Array
from airrace.pages.report.flight_page import flight_page

HOSTILE = (
    "<script>window.hacked = 1</script>",
    "]]> --><!-- </script>",
    "\"'><img src=x onerror=hacked()>",
    "x" * 10_000,
)
"""Names that people might give, of courses and of flights."""


@dataclass
class Read(HTMLParser):
    """A page as a parser reads it: elements with their attributes, and the text of those that matter here."""

    elements: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    texts: dict[str, list[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self._open = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag in ("script", "style", "title", "h1", "td", "button", "pre"):
            self._open = tag
            self.texts.setdefault(tag, []).append("")

    def handle_endtag(self, tag: str) -> None:
        if tag == self._open:
            self._open = ""

    def handle_data(self, data: str) -> None:
        if self._open:
            self.texts[self._open][-1] += data

    def named(self, tag: str) -> list[dict[str, str | None]]:
        """The attributes of all elements of a kind."""
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def contents(self) -> Any:
        """What the script is told. Any: it is read from JSON."""
        return json.loads(self.texts["script"][0])


def read(page: str) -> Read:
    parser = Read()
    parser.feed(page)
    parser.close()
    return parser


def unpack(text: str) -> Array:
    """The numbers of a history."""
    return np.frombuffer(base64.b64decode(text), dtype="<f4").astype(np.float64)


@functools.cache
def circle(seconds: float = 20.0) -> Flight:
    """A circle through the passings of Rovinj."""
    return circling(rovinj(), seconds=seconds)


def labelled(flight: Flight, label: str) -> Flight:
    """The same flight under another label."""
    return with_(flight, source=with_(flight.source, label=label))


@functools.cache
def whole_page() -> str:
    """A page about a circle, with a slower one beside it."""
    return flight_page([circle(), labelled(circle(25.0), "slower")])


def renamed(name: str) -> Flight:
    """The circle on a course, past a gate, in an aircraft and under a label of this name."""
    race = rovinj()
    passages = tuple(
        with_(one, name=f"{number}:{name}", element=with_(one.element, name=name)) if number == 3 else one
        for number, one in enumerate(race.course.passages)
    )
    course = with_(race.course, name=name, passages=passages)
    other = with_(race, course=course, aircraft=with_(race.aircraft, name=name))
    return circling(other, label=name)


def everything_flown(folder: Path) -> Flight:
    """A circle on the course that has everything the track language knows."""
    return circling(race_of(everything(folder)))


def dense(flight: Flight, seconds: float) -> Flight:
    """The same flight slowed down to so many seconds, on as many samples as an optimum has."""
    slowed = seconds / float(flight.time[-1])
    times = np.arange(0.0, math.floor(seconds * 50.0) + 1) / 50.0
    stretched = flight.at(times / slowed)
    crossings = tuple(with_(one, time=one.time * slowed) for one in flight.crossings)
    return with_(stretched, time=times, crossings=crossings)
