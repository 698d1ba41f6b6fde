"""Files of JSBSim: elements with their lines, and numbers with their units.

An attribute `unit` is honoured; without one a number has the first unit of its kind, which JSBSim takes for granted. A
section may lie in a file of its own, named by the attribute `file`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Never
from xml.etree.ElementTree import Element
from xml.parsers import expat

from airrace.flights.logs.recording import refuse
from airrace.flights.logs.xml_document import parse_xml
from airrace.optimal_control.quantities import FOOT

INCH, POUND, HORSEPOWER = FOOT / 12.0, 0.45359237, 745.69987
"""The inch, m; the pound of mass, kg; 550 foot-pounds per second, W."""
SLUG = 32.174049 * POUND
"""The slug, kg, with JSBSim's own ratio of slug to pound (`FGJSBBase::slugtolb`)."""
Units = Mapping[str, float]
LENGTH: Units = {"FT": FOOT, "IN": INCH, "M": 1.0}
STRUCTURE: Units = {"IN": INCH, "FT": FOOT, "M": 1.0}
"""Places in the structure, and diameters."""
AREA: Units = {"FT2": FOOT**2, "IN2": INCH**2, "M2": 1.0}
MASS: Units = {"LBS": POUND, "KG": 1.0, "SLUG": SLUG}
INERTIA: Units = {"SLUG*FT2": SLUG * FOOT**2, "KG*M2": 1.0}
POWER: Units = {"HP": HORSEPOWER, "WATTS": 1.0}
PLAIN: Units = {"": 1.0}
SIZE_MAX = 20_000_000
"""The largest file that is read, bytes; the largest of JSBSim's own aircraft has 0.2 million."""


@dataclass(frozen=True, eq=False)
class JsbsimDocument:
    """A file: its path, its root, and the first line of every element by its identity."""

    path: Path
    root: Element
    lines: dict[int, int]

    def refuse(self, element: Element, message: str) -> Never:
        """Refuse the file for an element.

        Raises:
            InputError: always.
        """
        refuse(str(self.path), self.lines.get(id(element), 0), message, element.tag)

    def place(self, element: Element) -> str:
        """The file's name and the line of an element, for remarks."""
        return f"{self.path.name}:{self.lines[id(element)]}"

    def section(self, name: str) -> "JsbsimDocument":
        """Return a section, of which the root is the section, from a file of its own where it has one.

        Raises:
            InputError: there is none, or its file cannot be read.
        """
        section = self.child(self.root, name)
        if section.get("file"):
            return self.named_file(section, self.path.parent)
        return JsbsimDocument(self.path, section, self.lines)

    def named_file(self, element: Element, *folders: Path) -> "JsbsimDocument":
        """Read the file that an element names, in one of the folders; its ending may be left out.

        Raises:
            InputError: it is in none of them, or cannot be read.
        """
        name = element.get("file", "")
        paths = [path for folder in folders for path in (folder / name, folder / f"{name}.xml") if path.is_file()]
        if not paths:
            self.refuse(element, f"names the file {name!r}, which is in none of {', '.join(map(str, folders))}")
        return read_jsbsim(paths[0])

    def child(self, parent: Element, name: str) -> Element:
        """Return the first child of a name; refuse the file where there is none."""
        child = parent.find(name)
        if child is None:
            self.refuse(parent, f"has no <{name}>")
        return child

    def measure(self, parent: Element, name: str, units: Units, default: float | None = None) -> float:
        """Return the number of a child in SI units; the default, if there is one, where there is no child."""
        if default is not None and parent.find(name) is None:
            return default
        child = self.child(parent, name)
        return self.numbers(child, child.text, 1)[0] * self.unit(child, units)

    def place_of(self, location: Element) -> list[float]:
        """Return a place in the structure, m: back, right and up."""
        unit = self.unit(location, STRUCTURE)
        return [self.measure(location, axis, PLAIN) * unit for axis in "xyz"]

    def unit(self, element: Element, units: Units) -> float:
        """Return the SI value of an element's unit."""
        unit = element.get("unit", next(iter(units))).upper()
        if unit not in units and units is not PLAIN:
            self.refuse(element, f"has the unit {unit!r}; read are {', '.join(units)}")
        return units.get(unit, 1.0)

    def numbers(self, element: Element, text: str | None, count: int | None = None) -> list[float]:
        """Return the numbers of a text of an element, `count` of them where it is given."""
        words = (text or "").split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) != len(words) or count not in (None, len(values)) or not all(map(math.isfinite, values)):
            expected = "a number" if count == 1 else "numbers"
            self.refuse(element, f"must hold {expected}; holds {' '.join(words)[:40]!r}")
        return values


def read_jsbsim(path: Path) -> JsbsimDocument:
    """Read a file of JSBSim; a document type is refused, for its entities could grow beyond all memory.

    Raises:
        InputError: it cannot be read, or is no XML.
    """
    lines: dict[int, int] = {}
    try:
        if path.stat().st_size > SIZE_MAX:
            refuse(str(path), 0, f"has more than {SIZE_MAX // 1_000_000} MB, no aircraft of JSBSim")
        root = parse_xml(str(path), path.read_bytes(), lambda element, line: lines.update({id(element): line}))
    except OSError as error:
        refuse(str(path), 0, f"cannot be read: {error.strerror}")
    except expat.ExpatError as error:
        refuse(str(path), error.lineno, f"is no XML: {expat.ErrorString(error.code)}")
    assert root is not None  # all is read
    return JsbsimDocument(path, root, lines)
