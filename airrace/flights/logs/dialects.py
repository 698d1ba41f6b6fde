"""Recorders and programs whose columns are known, by the shipped table `dialects.toml`."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files


@dataclass(frozen=True)
class Dialect:
    """The columns of a recorder or a program.

    Attributes:
        name: of the recorder.
        headers: by which it is recognised, as `plain_header` returns them.
        columns: by the name of the quantity, the headers that it may have, the best first, each with its unit; an empty
            unit is found out.
        source: where the headers are described.
        instance: the header of a column that numbers several receivers, of which the first one is read; else empty.
    """

    name: str
    headers: frozenset[str]
    columns: Mapping[str, Sequence[tuple[str, str]]]
    source: str
    instance: str = ""


def plain_header(header: str) -> str:
    """Return a header in small letters, without its unit in brackets, with blanks for underscores."""
    base = header.partition("(")[0] if header.rstrip().endswith(")") else header
    base = base.partition("[")[0] if base.rstrip().endswith("]") else base
    return " ".join(base.replace("_", " ").lower().split())


def dialect_of(headers: Sequence[str]) -> Dialect | None:
    """Return the dialect that headers are of; None where they are of no known one."""
    there = {plain_header(header) for header in headers}
    return next((dialect for dialect in DIALECTS if dialect.headers <= there), None)


def _read_dialects() -> tuple[Dialect, ...]:
    dialects: list[Dialect] = []
    text = files("airrace.flights.logs").joinpath("dialects.toml").read_text("utf-8")
    for name, entries in tomllib.loads(text).items():
        headers, source, instance = entries.pop("headers"), entries.pop("source"), entries.pop("instance", "")
        columns = {quantity: [_split(text) for text in texts] for quantity, texts in entries.items()}
        dialects.append(Dialect(name, frozenset(headers), columns, source, instance))
    return tuple(dialects)


def _split(text: str) -> tuple[str, str]:
    """Return header and unit of `HEADER [UNIT]`."""
    header, _, unit = text.partition(" [")
    return header, unit.removesuffix("]")


DIALECTS = _read_dialects()
"""The dialects of the shipped table, in its order."""
