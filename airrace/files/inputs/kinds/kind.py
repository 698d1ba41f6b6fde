"""The base of every kind of element in the track language, the registration of kinds, and the keys that gates share."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, TypeVar, get_args

from annotated_types import Ge, Gt, Le

from airrace.files.inputs.nodes import KeyPath
from airrace.files.inputs.places import ClimbAngle, Height, Places
from airrace.files.inputs.schema import Schema, optional
from airrace.model.track.course import Direction, Roll
from airrace.model.track.element import PYLON_HEIGHT, Element
from airrace.model.track.polygons import Point
from airrace.runtime.extensions import load_extensions

HEIGHT_BAND_M = 5.0
"""How far the legal heights reach above and below the nominal one where a file says nothing, m."""

Reach = Annotated[float, Gt(0), Le(5000)]


@dataclass(frozen=True)
class ElementPart:
    """A passage of a composite element.

    Attributes:
        direction: None where the course says it.
        roll: on the leg that ends here.
    """

    element: Element
    direction: Direction | None = None
    roll: Roll | None = None


@dataclass(frozen=True)
class CompositeElement:
    """An entry of `gates` by its name, as its passages: mostly one; a quad or a vertical roll has two.

    With `free_directions` each passing may be planned for itself.
    """

    name: str
    parts: tuple[ElementPart, ...]
    free_directions: bool = True

    @property
    def path(self) -> KeyPath:
        return ("gates", self.name)

    @property
    def position(self) -> tuple[Point, float] | None:
        """The place of the element, and its nominal height (m); None if they are free."""
        position = self.parts[0].element.position
        return None if position is None else (Point(position[0], position[1]), position[2])


class PassingEntry(Schema):
    """The keys that gates and pylons have in common; an absent one takes the value of `gate_defaults`."""

    height_m: Height | None = optional(
        "nominal height of the passing above the origin; exact where `passing` is `point`"
    )
    passing: Literal["point", "window"] | None = optional(
        "`point`: passed exactly here; `window`: anywhere within the tolerances"
    )
    clearance_m: Annotated[float, Ge(0), Le(50)] | None = optional("least distance of the wing tips from a pylon")
    pylon_height_m: Annotated[float, Gt(0), Le(500)] | None = optional(
        "height of its pylons above the origin, up to which the wing keeps clear of them"
    )
    height_min_m: Height | None = optional("least legal height of a `window` passing")
    height_max_m: Height | None = optional("largest legal height of a `window` passing")
    climb_min_deg: ClimbAngle | None = optional("least climb angle at the passing, negative in descent")
    climb_max_deg: ClimbAngle | None = optional("largest climb angle at the passing")
    crossing_max_deg: Annotated[float, Gt(0), Le(85)] | None = optional(
        "largest horizontal angle between the path and the axis"
    )


class GatePassingEntry(PassingEntry):
    """The keys that all two-pylon gates have in common."""

    width_m: Annotated[float, Gt(0), Le(500)] | None = optional("distance between the two pylons")
    bank_tolerance_deg: Annotated[float, Gt(0), Le(90)] | None = optional(
        "largest deviation from the prescribed bank in a `window` passing"
    )


class GateDefaultsEntry(GatePassingEntry):
    """The values of keys that gates and pylons leave out.

    `clearance_m` is meant for two-pylon gates alone: at a single pylon it has its own default.
    """

    what: ClassVar[str] = "gate_defaults"
    reach_m: Reach | None = optional("farthest distance from a single pylon at which its passing counts")


LANGUAGE_DEFAULTS = GateDefaultsEntry(
    height_m=20.0,
    passing="window",
    clearance_m=0.5,
    pylon_height_m=PYLON_HEIGHT,
    climb_min_deg=-45.0,
    climb_max_deg=45.0,
    crossing_max_deg=60.0,
    width_m=13.0,
    bank_tolerance_deg=10.0,
    reach_m=100.0,
)
"""The values where neither a gate nor `gate_defaults` gives one.

By the race rules of 2014 to 2019 pylons are 25 m high, gates 10 to 14 m wide, the legal height is about 15 to 25 m,
wings are level within 10 degrees; the rest are choices.
"""


def passing_numbers(entry: PassingEntry, defaults: GateDefaultsEntry) -> dict[str, float]:
    """Return the numbers of a passing by their keys: its own, else those of `gate_defaults`, which must be complete."""
    numbers: dict[str, Any] = {}  # Any: None stands for a height that follows from the nominal one
    for key in GateDefaultsEntry.model_fields:
        if key in type(entry).model_fields and key != "passing":
            own = getattr(entry, key)
            numbers[key] = getattr(defaults, key) if own is None else own
    return numbers | {key: value for key, value in height_band(numbers["height_m"]).items() if numbers[key] is None}


def height_band(height: float) -> dict[str, float]:
    """Return the legal heights around a nominal one (m) where a file says nothing, by their keys."""
    return {"height_min_m": max(0.0, height - HEIGHT_BAND_M), "height_max_m": height + HEIGHT_BAND_M}


class KindEntry(Schema):
    """An entry of `gates`. A kind of element is one class derived from this, with its keys and a `type` of its own:

    type: Literal["ring"] = Field(description="a ring, passed through in any attitude")
    """

    @abstractmethod
    def build(self, name: str, defaults: GateDefaultsEntry, places: Places) -> CompositeElement:
        """Return the passages of an entry of this kind; invalid values go to the reporter of `places`.

        Args:
            name: the key of the entry in `gates`.
            defaults: `gate_defaults` of the file, completed.
            places: the positions of the file.
        """

    def numbers(self, defaults: GateDefaultsEntry) -> Mapping[str, float]:
        """Return the numbers that hold where the entry gives none, by their keys; its own may be among them.

        Args:
            defaults: `gate_defaults` of the file, completed.
        """
        return {}


Kind = TypeVar("Kind", bound=type[KindEntry])
_kinds: list[type[KindEntry]] = []


def register(kind: Kind) -> Kind:
    """Add a kind of element to the track language (a class decorator).

    An extension that calls this needs nothing else: import it, or name it in `AIRRACE_EXTENSIONS`.

    Raises:
        ValueError: the class declares no `type`, or one that is a kind's already.
    """
    types = _types(kind)
    if not types:
        raise ValueError(f'{kind.__name__} declares no `type: Literal["..."]` by which a file could name it')
    for registered in _kinds:
        if duplicates := types & _types(registered):
            raise ValueError(f"there is a kind of element of the type {min(duplicates)} already")
    _kinds.append(kind)
    return kind


def kinds() -> tuple[type[KindEntry], ...]:
    """Return all kinds, those of extensions included."""
    load_extensions()
    return tuple(_kinds)


def _types(kind: type[KindEntry]) -> set[str]:
    declared = kind.model_fields.get("type")
    return set() if declared is None else set(get_args(declared.annotation))
