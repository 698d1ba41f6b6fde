"""The base of every kind of element in the track language: its keys, and what they make of it."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import TypeVar

from airrace.inputs.features import Feature
from airrace.inputs.kinds.defaults import GateDefaultsEntry
from airrace.inputs.places import Places
from airrace.inputs.schema import Schema

Value = TypeVar("Value")


class KindEntry(Schema):
    """An entry of `gates`. A kind of element is one class derived from this, with its keys and a `type` of its own:

    type: Literal["ring"] = Field(description="a ring, flown through in any attitude")
    """

    @abstractmethod
    def feature(self, name: str, defaults: GateDefaultsEntry, places: Places) -> Feature:
        """Return what an entry of this kind is flown as; what makes no sense goes to the reporter of `places`.

        Args:
            name: the key of the entry in `gates`.
            defaults: `gate_defaults` of the file.
            places: the positions of the file.
        """

    def silent_numbers(self, feature: Feature) -> Mapping[str, float | None]:
        """Return the numbers that hold where the entry says none, by their keys.

        Args:
            feature: what the entry is flown as.
        """
        return {}


def chosen(own: Value | None, default: Value | None, silent: Value) -> Value:
    """Return the element's own value, else that of `gate_defaults`, else that of the language."""
    if own is not None:
        return own
    return silent if default is None else default
