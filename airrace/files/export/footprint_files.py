"""Footprints in files: outlines on the globe beside course and flight, all impacts as comma-separated values."""

import csv
import io
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from airrace.files.export.csv_cells import text_cell
from airrace.files.export.geojson import collection, feature, flight_entries
from airrace.files.export.globe import Corner, add_element, cut_area
from airrace.files.export.kml import content_of, kml_document
from airrace.flights.results import Flight
from airrace.flights.safety.footprint import GLIDE_EVERY, NOT_AN_AUTHORITYS, Footprint
from airrace.flights.safety.outlines import Outline
from airrace.model.track.course import Origin, geodetic
from airrace.optimal_control.trajectory import Array

FALLS, GLIDES = "free fall", "glide without power"


def footprint_geojson(footprint: Footprint, flight: Flight, begin: datetime) -> bytes:
    """Return course, flight (on the globe, its clock starting at `begin`) and footprint as GeoJSON (RFC 7946)."""
    entries = flight_entries([flight], begin)
    for name, outlines in _layers(footprint):
        rings: list[list[list[Corner]]] = []
        for outline in outlines:
            rings += _polygons(outline, flight.course.origin)
        properties = {"kind": "footprint", "name": name, "note": NOT_AN_AUTHORITYS}
        entries.append(feature("MultiPolygon", rings, properties))
    return collection(entries)


def footprint_kml(footprint: Footprint, flight: Flight, begin: datetime) -> bytes:
    """Return course, flight and footprint as KML 2.2; arguments are those of `footprint_geojson`."""
    document = kml_document([flight], begin)
    for (name, outlines), colour in zip(_layers(footprint), ("2b39c0", "b8865b"), strict=True):  # blue, green, red
        mark = add_element(document, "Placemark")
        add_element(mark, "name", name)
        add_element(mark, "description", NOT_AN_AUTHORITYS)
        style = add_element(mark, "Style")
        add_element(add_element(style, "LineStyle"), "color", "ff" + colour)
        add_element(add_element(style, "PolyStyle"), "color", ("60" if name == FALLS else "10") + colour)
        pieces = add_element(mark, "MultiGeometry")
        for outline in outlines:
            polygon = add_element(pieces, "Polygon")
            for kind, ring in (("outer", outline.border), *(("inner", hole) for hole in outline.holes)):
                places = (f"{east:.7f},{north:.7f}" for east, north in _close(ring, flight.course.origin))
                boundary = add_element(add_element(polygon, f"{kind}BoundaryIs"), "LinearRing")
                add_element(boundary, "coordinates", " ".join(places))
    return content_of(document)


def footprint_csv(footprint: Footprint) -> str:
    """Return one row per instant: where the aircraft is and where it falls to, m, and how far that is from people."""
    states = footprint.states
    columns: dict[str, Array] = {"time_s": footprint.time}
    columns |= dict(zip(("north_m", "east_m", "height_m"), states.place.T, strict=True))
    columns["ground_speed_m_s"] = states.speed
    for name, fall in (("vacuum", footprint.vacuum), ("drag", footprint.drag)):
        columns |= {f"{name}_north_m": fall.place[:, 0], f"{name}_east_m": fall.place[:, 1]}
        columns |= {f"{name}_fall_s": fall.time, f"{name}_impact_m_s": fall.speed}
    columns |= {f"{name}_way_m": way for name, way in footprint.lengths.items()}
    glide = np.full((len(footprint.time), 2), np.nan)
    glide[footprint.glide_rows] = footprint.reach.straight
    columns |= {"glide_north_m": glide[:, 0], "glide_east_m": glide[:, 1]}
    columns |= {f"{crowd.name}_distance_m": footprint.distances(crowd) for crowd in footprint.race.course.crowd}
    text = io.StringIO(newline="")
    text.write(f"# {NOT_AN_AUTHORITYS}\n# glides: one for every {GLIDE_EVERY} instants\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["flight", *map(text_cell, columns)])
    rows = np.stack(list(columns.values()), axis=1).tolist()
    for label, row in zip(footprint.labels, rows, strict=True):
        writer.writerow([text_cell(label), *("" if value != value else f"{value + 0.0:.10g}" for value in row)])
    return text.getvalue()


def _layers(footprint: Footprint) -> list[tuple[str, Sequence[Outline]]]:
    return [(FALLS, footprint.falls), (GLIDES, (footprint.glides,))]


def _polygons(outline: Outline, origin: Origin) -> list[list[list[Corner]]]:
    """Return the rings of each part of an outline on one side of the antimeridian."""
    parts: dict[bool, list[list[Corner]]] = {}
    for ring in (outline.border, *outline.holes):
        for piece in cut_area(_close(ring, origin)[:-1]):
            parts.setdefault(sum(corner[0] for corner in piece) > 0.0, []).append([*piece, piece[0]])
    return list(parts.values())


def _close(ring: Array, origin: Origin) -> list[list[float]]:
    """Return longitude and latitude of the corners of a ring, degrees, the first again at its end."""
    latitude, longitude = geodetic(ring[:, 0], ring[:, 1], origin)
    places = np.round(np.degrees(np.stack([longitude, latitude], axis=1)), 7)
    return [*places.tolist(), places[0].tolist()]
