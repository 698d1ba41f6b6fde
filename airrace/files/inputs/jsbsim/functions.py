"""JSBSim's functions: formulas and tables over named properties, evaluated at the values of some of them.

Tables of one to three variables are interpolated linearly and hold their end values beyond, as in JSBSim. A named
function is a property of its own name. A property that has no value counts as 0, and is noted.
"""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from xml.etree.ElementTree import Element

import numpy as np

from airrace.files.inputs.jsbsim.document import JsbsimDocument

OF_ANY: Mapping[str, Callable[[Sequence[float]], float]] = {
    "pi": lambda a: math.pi,
    "sum": sum,
    "product": math.prod,
    "difference": lambda a: a[0] - sum(a[1:]),
    "min": min,
    "max": max,
    "avg": lambda a: sum(a) / len(a),
    "and": all,
    "or": any,
    "ifthen": lambda a: a[1] if a[0] else a[2],
    "switch": lambda a: a[1:][round(a[0])],
    "interpolate1d": lambda a: float(np.interp(a[0], a[1::2], a[2::2])),
    "sign": lambda a: -1.0 if a[0] < 0.0 else 1.0,
    "integer": lambda a: math.trunc(a[0]),
    "fraction": lambda a: math.modf(a[0])[0],
}
"""Operations of any number of operands; left out are those that are random, turn frames, or depend on time."""
_LIKE_PYTHON = ("sqrt", "exp", "log2", "log10", "sin", "cos", "tan", "asin", "acos", "atan", "floor", "ceil")
OF_ONE_OR_TWO: Mapping[str, Callable[..., float]] = {
    "quotient": float.__truediv__,
    "mod": float.__mod__,
    "pow": math.pow,
    "fmod": math.fmod,
    "atan2": math.atan2,
    "nq": operator.ne,
    "lt": operator.lt,
    "le": operator.le,
    "gt": operator.gt,
    "ge": operator.ge,
    "eq": operator.eq,
    "not": operator.not_,
    "ln": math.log,
    "abs": math.fabs,
    "toradians": math.radians,
    "todegrees": math.degrees,
    **{name: getattr(math, name) for name in _LIKE_PYTHON},
}
ABOUT = ("description", "documentation")
"""Elements of a function that say something about it."""


class NotEvaluated(Exception):
    """A function that is beyond this reader; its text says why, with the line."""


class Functions:
    """The functions of a section, by name, and the values that an aircraft's file declares for properties.

    `assumed` grows with every property that had no value and was taken as 0.
    """

    def __init__(self, section: JsbsimDocument, aircraft: JsbsimDocument) -> None:
        self.section = section
        self.assumed: set[str] = set()
        self._declared: dict[str, float] = {}
        for element in aircraft.root.iter("property"):
            if (value := element.get("value")) is not None:
                self._declared[(element.text or "").strip()] = aircraft.numbers(element, value, 1)[0]
        self._tables: dict[int, JsbsimTable] = {}
        self._named = {name: function for function in section.root.iter("function") if (name := function.get("name"))}

    def value(self, function: Element, state: Mapping[str, float]) -> float:
        """Return the value of a function at the values of properties, in JSBSim's units.

        Raises:
            NotEvaluated: it holds an operation that this reader does not know, or has no value.
            RecursionError: it depends on itself.
            InputError: it is no function of JSBSim.
        """
        content = [child for child in function if child.tag not in ABOUT]
        if len(content) != 1:
            self.section.refuse(function, f"must hold one formula; holds {len(content)}")
        return self._operand(content[0], state)

    def _property(self, name: str, state: Mapping[str, float]) -> float:
        if name.startswith("-"):
            return -self._property(name[1:].strip(), state)
        if name in state:
            return state[name]
        function = self._named.get(name)
        if function is None:
            if name not in self._declared:
                self.assumed.add(name)
            return self._declared.get(name, 0.0)
        return self.value(function, state)

    def _operand(self, element: Element, state: Mapping[str, float]) -> float:
        match element.tag:
            case "value" | "v":
                return self.section.numbers(element, element.text, 1)[0]
            case "property" | "p":
                return self._property((element.text or "").strip(), state)
            case "table" | "t":
                return self._looked_up(element, state)
            case "function":
                return self.value(element, state)
            case name:
                return self._operation(name, element, state)

    def _operation(self, name: str, element: Element, state: Mapping[str, float]) -> float:
        arguments = [self._operand(child, state) for child in element if child.tag not in ABOUT]
        place, values = self.section.place(element), ", ".join(f"{argument:g}" for argument in arguments)
        try:
            if name in OF_ANY:
                return float(OF_ANY[name](arguments))
            if name in OF_ONE_OR_TWO:
                return float(OF_ONE_OR_TWO[name](*arguments))
        except TypeError:
            self.section.refuse(element, f"has another number of operands than {len(arguments)}")
        except (ArithmeticError, ValueError, IndexError):
            raise NotEvaluated(f"<{name}> at {place} has no value at {values}") from None
        raise NotEvaluated(f"<{name}> at {place} is no operation that is read")

    def _looked_up(self, element: Element, state: Mapping[str, float]) -> float:
        variables = {child.get("lookup", "row"): (child.text or "").strip() for child in element.iter("independentVar")}
        names = [variables[kind] for kind in ("row", "column", "table") if kind in variables]
        if not names or (len(names) == 2 and "table" in variables) or len(names) < len(variables):
            self.section.refuse(element, f"must look up row, column and table; looks up {', '.join(variables) or 0}")
        table = self._tables.get(id(element))
        if table is None:
            table = self._tables[id(element)] = read_table(self.section, element, len(names))
        return table(*(self._property(name, state) for name in names))


@dataclass(frozen=True)
class JsbsimTable:
    """A table of one to three variables.

    Attributes:
        knots: of the variable that is looked up last: rows; columns of a sheet's row; sheets.
        values: at the knots: numbers, or what is still to be looked up, the other variables first.
    """

    knots: Sequence[float]
    values: Sequence["float | JsbsimTable"]

    def __call__(self, *places: float) -> float:
        """Return the value at as many places as there are variables: row, column, sheet."""
        *inner, last = places
        values = [value(*inner) if isinstance(value, JsbsimTable) else value for value in self.values]
        return float(np.interp(last, self.knots, values))


def read_table(document: JsbsimDocument, element: Element, variables: int) -> JsbsimTable:
    """Return the table of an element, which has so many variables.

    Raises:
        InputError: it is no such table.
    """
    data = element.findall("tableData")
    if not data or (len(data) > 1) != (variables == 3):
        document.refuse(element, f"must hold tableData for {variables} variables; holds {len(data)}")
    sheets = [_sheet(document, sheet, min(variables, 2)) for sheet in data]
    if variables < 3:
        return sheets[0]
    breaks = [document.numbers(sheet, sheet.get("breakPoint"), 1)[0] for sheet in data]
    return JsbsimTable(_increasing(document, element, breaks), sheets)


def _sheet(document: JsbsimDocument, sheet: Element, variables: int) -> JsbsimTable:
    lines = [document.numbers(sheet, line) for line in (sheet.text or "").splitlines() if line.strip()]
    columns = lines.pop(0) if variables == 2 and lines else [0.0]
    if not lines or any(len(line) != len(columns) + 1 for line in lines):
        form = "pairs of numbers" if variables == 1 else "a line of columns, and rows with one number more"
        document.refuse(sheet, f"must hold {form}")
    rows = _increasing(document, sheet, [line[0] for line in lines])
    along = [JsbsimTable(rows, values) for values in zip(*(line[1:] for line in lines), strict=True)]
    return along[0] if variables == 1 else JsbsimTable(_increasing(document, sheet, columns), along)


def _increasing(document: JsbsimDocument, element: Element, knots: Sequence[float]) -> Sequence[float]:
    if any(later <= earlier for earlier, later in pairwise(knots)):
        document.refuse(element, "must have knots that increase from each to the next")
    return knots
