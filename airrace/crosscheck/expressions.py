"""Formulas as JSBSim reads them: trees of XML elements.

A term is a number, the name of a property, or a formula.
"""

from xml.etree.ElementTree import Element

Term = float | str | Element


def formula(kind: str, *terms: Term) -> Element:
    """Return one operation, e.g. `sum`, `product`, `quotient`, `difference`, `pow`, `sqrt`."""
    element = Element(kind)
    element.extend(_operand(term) for term in terms)
    return element


def element(tag: str, *children: Element, text: str | None = None, **attributes: str) -> Element:
    """Return an element with children, text and attributes."""
    made = Element(tag, attributes)
    made.text = text
    made.extend(children)
    return made


def function(name: str, value: Element) -> Element:
    """Return a formula whose value is the property `name`."""
    return element("function", value, name=name)


def square(term: Term) -> Element:
    """Return the term times itself."""
    return formula("pow", term, 2.0)


def smooth_clip(term: Term, lower: Term, upper: Term, width: float) -> Element:
    """Return the term rounded off at two limits, as `airrace.environment.elementary.smooth_clip` does."""

    def distance(limit: Term) -> Element:
        return formula("sqrt", formula("sum", square(formula("difference", term, limit)), width * width))

    return formula(
        "product", 0.5, formula("difference", formula("sum", lower, upper, distance(lower)), distance(upper))
    )


def _operand(term: Term) -> Element:
    if isinstance(term, Element):
        return term
    if isinstance(term, str):
        return element("property", text=term)
    return element("value", text=repr(float(term)))  # repr gives a number that reads back exactly
