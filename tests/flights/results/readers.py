"""Readers of exported files, written from the formats' documentation alone; they share nothing with the writers."""

import math
from dataclasses import dataclass, field
from datetime import datetime
from xml.etree import ElementTree as ET

KML, GX = "{http://www.opengis.net/kml/2.2}", "{http://www.google.com/kml/ext/2.2}"
GPX = "{http://www.topografix.com/GPX/1/1}"


@dataclass
class Recorded:
    """An object of a Tacview recording: its properties and its transforms in time.

    A transform is longitude, latitude, altitude, roll, pitch and yaw, NaN where one is left out.
    """

    properties: dict[str, str] = field(default_factory=dict)
    times: list[float] = field(default_factory=list)
    places: list[list[float]] = field(default_factory=list)
    numbers: dict[str, list[float]] = field(default_factory=dict)
    removed: float = math.inf


def read_acmi(content: bytes) -> tuple[dict[str, Recorded], list[tuple[float, list[str]]]]:
    """Objects by their hexadecimal names, "0" for the global one, and events as (time, fields)."""
    lines = content.decode("utf-8-sig").splitlines()
    assert lines[:2] == ["FileType=text/acmi/tacview", "FileVersion=2.2"]
    objects: dict[str, Recorded] = {}
    events: list[tuple[float, list[str]]] = []
    now = 0.0
    for line in lines[2:]:
        if line.startswith("#"):
            assert float(line[1:]) >= now
            now = float(line[1:])
            continue
        if line.startswith("-"):
            objects[line[1:]].removed = now
            continue
        name, *fields = _split(line)
        int(name, 16)
        one = objects.setdefault(name, Recorded())
        for entry in fields:
            key, _, value = entry.partition("=")
            if key == "Event":
                events.append((now, value.split("|")))
            elif key == "T":
                one.times.append(now)
                one.places.append([float(part) if part else math.nan for part in value.split("|")])
            else:
                one.properties[key] = value
                if key not in ("Name", "Type", "Color", "TrackingSimulator", "CallSign") and one.times:
                    one.numbers.setdefault(key, []).append(float(value))
    return objects, events


def _split(line: str) -> list[str]:
    """At commas that no backslash precedes."""
    fields = [""]
    letters = iter(line)
    for letter in letters:
        if letter == "\\":
            fields[-1] += next(letters)
        elif letter == ",":
            fields.append("")
        else:
            fields[-1] += letter
    return fields


@dataclass
class Replay:
    """An X-Plane recording: header lines by keyword, columns by name, in the file's units."""

    header: dict[str, list[str]]
    columns: dict[str, list[float]]


def read_fdr(content: bytes) -> Replay:
    lines = content.decode("ascii").splitlines()
    assert lines[0] in ("A", "I")
    assert lines[1] == "4"
    header: dict[str, list[str]] = {}
    rows: list[list[float]] = []
    for line in lines[2:]:
        keyword = line[:4]
        if keyword.isalpha() and keyword.isupper():
            header.setdefault(keyword, []).append(line[5:].strip())
        elif line.strip():
            time, *numbers = (part.strip() for part in line.split(","))
            hours, minutes, seconds = time.split(":")
            rows.append([3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds), *map(float, numbers)])
    datarefs = [one.split("\t")[0].split("/")[-1] for one in header["DREF"]]
    names = ["time", "longitude", "latitude", "altitude_ft", "heading", "pitch", "roll", *datarefs]
    assert all(len(row) == len(names) for row in rows)
    return Replay(header, {name: [row[k] for row in rows] for k, name in enumerate(names)})


@dataclass
class Track:
    """A moving thing of a KML document."""

    name: str
    when: list[datetime]
    coordinates: list[list[float]]
    angles: list[list[float]]


def read_kml(content: bytes) -> tuple[dict[str, list[tuple[str, list[list[float]]]]], list[Track]]:
    """Placemarks by name as (shape, coordinates) each, and tracks, whose elements stand in the order of the schema."""
    root = ET.fromstring(content)
    assert root.tag == f"{KML}kml"
    styles = {f"#{one.get('id')}" for one in root.iter(f"{KML}Style")}
    placemarks: dict[str, list[tuple[str, list[list[float]]]]] = {}
    tracks: list[Track] = []
    for mark in root.iter(f"{KML}Placemark"):
        name = mark.findtext(f"{KML}name") or ""
        assert mark.findtext(f"{KML}styleUrl") in styles
        for shape in ("Point", "LineString", "LinearRing"):
            for geometry in mark.iter(f"{KML}{shape}"):
                texts = (geometry.findtext(f"{KML}coordinates") or "").split()
                places = [[float(part) for part in text.split(",")] for text in texts]
                placemarks.setdefault(name, []).append((shape, places))
        for track in mark.iter(f"{GX}Track"):
            tags = [child.tag for child in track]
            order = [f"{KML}altitudeMode", f"{KML}when", f"{GX}coord", f"{GX}angles"]
            assert tags == sorted(tags, key=order.index)
            tracks.append(
                Track(
                    name,
                    [datetime.fromisoformat(one.text or "") for one in track.iter(f"{KML}when")],
                    [[float(part) for part in (one.text or "").split()] for one in track.iter(f"{GX}coord")],
                    [[float(part) for part in (one.text or "").split()] for one in track.iter(f"{GX}angles")],
                )
            )
    return placemarks, tracks


def read_gpx(
    content: bytes,
) -> tuple[dict[str, tuple[float, float]], dict[str, list[tuple[datetime, float, float, float]]]]:
    """Waypoints by name, and tracks by name as rows of time, latitude, longitude and elevation."""
    root = ET.fromstring(content)
    assert (root.tag, root.get("version")) == (f"{GPX}gpx", "1.1")
    tags = [child.tag for child in root]
    assert tags == sorted(tags, key=[f"{GPX}wpt", f"{GPX}trk"].index)
    points = {
        one.findtext(f"{GPX}name") or "": (float(one.get("lat", "nan")), float(one.get("lon", "nan")))
        for one in root.iter(f"{GPX}wpt")
    }
    tracks = {}
    for track in root.iter(f"{GPX}trk"):
        rows = [
            (
                datetime.fromisoformat(one.findtext(f"{GPX}time") or ""),
                float(one.get("lat", "nan")),
                float(one.get("lon", "nan")),
                float(one.findtext(f"{GPX}ele") or "nan"),
            )
            for one in track.iter(f"{GPX}trkpt")
        ]
        tracks[track.findtext(f"{GPX}name") or ""] = rows
    return points, tracks
