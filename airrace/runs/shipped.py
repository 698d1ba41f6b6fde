"""The courses, aircraft and rule books that come with the package, by the names that every door takes."""

from dataclasses import asdict
from pathlib import Path

from airrace.inputs import load_inputs
from airrace.inputs.presets import preset_names
from airrace.inputs.shipped import AIRCRAFT, SUFFIX, TRACKS, Collection
from airrace.records import record


@record
class ShippedTrack:
    """A course that comes along.

    Attributes:
        name: what it is called in commands and in Python.
        title: its name as the file gives it.
        passages: passings of the whole race, start and finish included.
        laps: laps of the race.
        aircraft: the aircraft that its file names.
    """

    name: str
    title: str
    passages: int
    laps: int
    aircraft: str


@record
class ShippedAircraft:
    """An aircraft that comes along: its name, its name as the file gives it, and its mass (kg)."""

    name: str
    title: str
    mass: float


@record
class Shipped:
    """All that comes along; `rules` are the names that a track file's `rules` may give."""

    tracks: tuple[ShippedTrack, ...]
    aircraft: tuple[ShippedAircraft, ...]
    rules: tuple[str, ...]

    def as_object(self) -> dict[str, object]:
        """Return all that is listed as plain values, for JSON."""
        return {
            "tracks": [asdict(one) for one in self.tracks],
            "aircraft": [{"name": one.name, "title": one.title, "mass_kg": one.mass} for one in self.aircraft],
            "rules": list(self.rules),
        }


def shipped() -> Shipped:
    """Read the courses and aircraft that come along, in alphabetical order of their names."""
    return Shipped(tuple(map(_track, TRACKS.names)), tuple(map(_aircraft, AIRCRAFT.names)), preset_names())


def _track(name: str) -> ShippedTrack:
    inputs = load_inputs(_file(TRACKS, name))
    course = inputs.race.course
    laps = max(passage.lap for passage in course.passages)
    return ShippedTrack(name, course.name, len(course.passages), laps, Path(inputs.aircraft.path).stem)


def _aircraft(name: str) -> ShippedAircraft:
    any_track = _file(TRACKS, TRACKS.names[0])
    aircraft = load_inputs(any_track, aircraft=_file(AIRCRAFT, name)).race.aircraft
    return ShippedAircraft(name, aircraft.name, aircraft.airframe.m)


def _file(collection: Collection, name: str) -> Path:
    """Return the path of the shipped file of a name, whatever lies in the current folder under that name."""
    return collection.path / f"{name}{SUFFIX}"
