"""The list of the kinds of elements that a track file knows. It is the only one; `register` adds a further kind."""

import re
from typing import get_args

from airrace.extensions import load_extensions
from airrace.inputs.features import Feature
from airrace.inputs.kinds.defaults import GateDefaultsEntry
from airrace.inputs.kinds.entry import KindEntry
from airrace.inputs.kinds.gates import KnifeEdgeGateEntry, LevelGateEntry, PylonEntry, QuadEntry
from airrace.inputs.kinds.manoeuvres import HighTurnEntry, ManoeuvreEntry, VerticalRollEntry
from airrace.inputs.places import Places

_kinds: list[type[KindEntry]] = [
    LevelGateEntry,
    KnifeEdgeGateEntry,
    QuadEntry,
    PylonEntry,
    ManoeuvreEntry,
    HighTurnEntry,
    VerticalRollEntry,
]

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
NAME_RULE = "begin with a letter and go on with letters, digits, `_` and `-`"


def register(kind: type[KindEntry]) -> type[KindEntry]:
    """Add a kind of element to the track language (a class decorator).

    A file that calls this is all that a kind of one's own takes: import it, or name it in `AIRRACE_EXTENSIONS`.

    Raises:
        ValueError: the class declares no `type`, or one that is a kind's already.
    """
    types = _types(kind)
    if not types:
        raise ValueError(f'{kind.__name__} declares no `type: Literal["..."]` by which a file could name it')
    if taken := types & {name for one in _kinds for name in _types(one)}:
        raise ValueError(f"there is a kind of element of the type {min(taken)} already")
    _kinds.append(kind)
    return kind


def kinds() -> tuple[type[KindEntry], ...]:
    """Return all kinds, those of extensions included."""
    load_extensions()
    return tuple(_kinds)


def build_features(entries: dict[str, KindEntry], defaults: GateDefaultsEntry, places: Places) -> dict[str, Feature]:
    """Return all entries of `gates` as features by name; what makes no sense is reported."""
    built: dict[str, Feature] = {}
    for name, entry in entries.items():
        if not NAME.fullmatch(name):
            places.reporter.key(("gates", name), "a gate's name must " + NAME_RULE)
        built[name] = entry.feature(name, defaults, places)
    return built


def _types(kind: type[KindEntry]) -> set[str]:
    declared = kind.model_fields.get("type")
    return set() if declared is None else set(get_args(declared.annotation))
