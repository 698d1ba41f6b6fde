"""Jobs: everything that is needed to fly one course once, as values."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from functools import cache
from typing import Any, Self

from airrace.inputs import Document
from airrace.records import record


@record
class Fingerprint:
    """All that the result of a job depends on; each part is a hash or a short text, so that a change can be named.

    Attributes:
        track, aircraft, settings: sha256 of the documents' texts; `settings` is empty where the defaults are used.
        overrides: sha256 of the `key=value` texts, in their order.
        until: the last stage.
        versions: the versions of airrace and of what its numbers depend on, as one text.
    """

    track: str
    aircraft: str
    settings: str
    overrides: str
    until: str
    versions: str

    def changes(self, earlier: Self) -> list[str]:
        """Return what differs from an earlier fingerprint, one clause for each part."""
        return [
            _clause(field.name, getattr(earlier, field.name), getattr(self, field.name))
            for field in fields(self)
            if getattr(earlier, field.name) != getattr(self, field.name)
        ]


@record
class Job:
    """A course to be flown once. It holds texts, not files, so it means the same on any machine.

    Attributes:
        name: stable, readable, a valid name of a file; unique in its batch. The checkpoint is `NAME.h5`.
        course: the course's own name in reports: that of its file.
        track, aircraft: the documents.
        settings: None for the defaults.
        overrides: `key=value`, in their order: those of `--set`, then those of the sweeps.
        swept: the value of every sweep, by key: what tells this job from its siblings.
        until: the name of the last stage.
        versions: those of airrace and of what its numbers depend on, on the machine that planned the job.
    """

    name: str
    course: str
    track: Document
    aircraft: Document
    settings: Document | None
    overrides: tuple[str, ...]
    swept: tuple[tuple[str, str], ...]
    until: str
    versions: str

    @property
    def fingerprint(self) -> Fingerprint:
        return Fingerprint(
            track=_hash_of(self.track.text),
            aircraft=_hash_of(self.aircraft.text),
            settings="" if self.settings is None else _hash_of(self.settings.text),
            overrides=hash_of_all(self.overrides),
            until=self.until,
            versions=self.versions,
        )

    def as_object(self) -> dict[str, object]:
        """Return the job as plain values, for JSON."""
        return asdict(self)

    # Any: JSON that `as_object` wrote.
    @classmethod
    def from_object(cls, plain: Mapping[str, Any]) -> Self:
        """Return the job that `as_object` was called on, also after a round trip through JSON.

        Raises:
            KeyError, TypeError: it is no such object.
        """
        settings = plain["settings"]
        return cls(
            name=plain["name"],
            course=plain["course"],
            track=Document(**plain["track"]),
            aircraft=Document(**plain["aircraft"]),
            settings=None if settings is None else Document(**settings),
            overrides=tuple(plain["overrides"]),
            swept=tuple((key, value) for key, value in plain["swept"]),
            until=plain["until"],
            versions=plain["versions"],
        )


def hash_of_all(texts: Iterable[str]) -> str:
    """Return the sha256 (hex) of several texts in their order."""
    return hashlib.sha256(json.dumps(list(texts)).encode()).hexdigest()


@cache
def _hash_of(text: str) -> str:
    """Return the sha256 (hex) of a text; cached, for thousands of jobs share few documents."""
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def _clause(part: str, before: str, now: str) -> str:
    match part:
        case "until":
            return f"the last stage was {before} and is {now}"
        case "versions":
            return f"it was flown with other versions ({before}; now {now})"
        case "overrides":
            return "--set or --sweep changed"
        case "settings":
            return "the settings changed"
        case _:
            return f"the {part} changed"
