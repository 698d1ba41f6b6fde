"""Measure how close the wing of a stored flight comes to every pylon of its course, at any time.

    python scripts/measure_wing_clearance.py RUN.h5 [--stage point-mass] [--below METRES] [--json]

An independent measurement: histories are read from the run, and all else is numpy. The wing is the line from tip to
tip, square to the body in stages that have one and to the path in the others. A pylon is a vertical line from the
ground up to its height. On every leg and lap each pylon has a row where the wing comes nearer than `--below`; the exit
code is 1 if it comes nearer than the pylon's clearance less a centimetre.

The distance is that of a segment from a vertical ray, found by ternary search along the wing, of a flight that is
sampled every 0.2 ms by cubics through positions with their velocities and through attitudes.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

import airrace
from airrace.flights.results.flight import Flight

Array = NDArray[np.float64]
Row = dict[str, Any]
STEP = 2e-4
"""The time between two samples, s: 2 cm of way at 100 m/s, so the distance is true within 0.1 mm from 0.5 m on."""
ALLOWED = 0.01
"""The length by which a clearance may be missed, m."""
UNASKED = 0.5
"""The clearance of pylons whose gate asks for no more, m."""


def pylons(flight: Flight) -> Iterator[tuple[str, Array, float, float]]:
    """Yield name, place (north, east), height and clearance of every pylon, m."""
    for element in {one.element.name: one.element for one in flight.course.passages}.values():
        drawing = element.drawing()
        window = getattr(getattr(element, "passing", None), "value", "") == "window"
        clearance = max(UNASKED, element.tolerances.clearance) if window else UNASKED  # type: ignore[attr-defined]
        for post in drawing.posts:
            yield element.name, np.array([post.north, post.east]), drawing.post_height, clearance


def wing(flight: Flight, times: Array) -> tuple[Array, Array]:
    """Return north, east and height of both wing tips at some times, each of shape (3, n)."""
    known = flight.time
    chi, gamma, V = flight["chi"], flight["gamma"], flight["V_K"]
    velocity = V * np.stack([np.cos(gamma) * np.cos(chi), np.cos(gamma) * np.sin(chi), np.sin(gamma)])
    position = np.stack([flight["x"], flight["y"], flight["height"]])
    # Seen from above the wing is the second column of the attitude's rotation; beta_K turns that of the path's frame.
    q = np.stack([flight[name] for name in ("q0", "q1", "q2", "q3")])
    forward = np.stack([_column(q, 0), _column(q, 1)])
    beta = flight["beta_K"] if "beta_K" in flight else np.zeros_like(known)
    right = np.sin(beta) * forward[0] + np.cos(beta) * forward[1]
    right[2] *= -1.0  # upwards
    half = 0.5 * flight.aircraft.airframe.b * cubics(known, right, np.gradient(right, known, axis=1), times)
    centre = cubics(known, position, velocity, times)
    return centre - half, centre + half


def _column(q: Array, number: int) -> Array:
    """Return a column of the rotation matrix of quaternions (4, n), scalar first; shape (3, n)."""
    a, b, c, d = q / np.linalg.norm(q, axis=0)
    if number == 0:
        return np.stack([a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)])
    return np.stack([2 * (b * c - a * d), a * a - b * b + c * c - d * d, 2 * (c * d + a * b)])


def cubics(time: Array, values: Array, rates: Array, wanted: Array) -> Array:
    """Return what is between values (k, n) with rates (k, n) at some times (m,): cubics; shape (k, m)."""
    step = np.clip(np.searchsorted(time, wanted, side="right") - 1, 0, len(time) - 2)
    h = time[step + 1] - time[step]
    s = (wanted - time[step]) / h
    return (
        (1 + 2 * s) * (1 - s) ** 2 * values[:, step]
        + s**2 * (3 - 2 * s) * values[:, step + 1]
        + h * s * (1 - s) ** 2 * rates[:, step]
        - h * s**2 * (1 - s) * rates[:, step + 1]
    )


def distance(left: Array, right: Array, place: Array, height: float) -> Array:
    """Return the distance of a vertical line up to a height from segments between tips (3, n); shape (n,)."""

    def away(share: Array) -> Array:
        point = left + share * (right - left)
        above = np.maximum(point[2] - height, 0.0)
        return np.sqrt((point[0] - place[0]) ** 2 + (point[1] - place[1]) ** 2 + above**2)

    low, high = np.zeros(left.shape[1]), np.ones(left.shape[1])
    for _ in range(40):  # the distance is convex along the segment
        a, b = low + (high - low) / 3, high - (high - low) / 3
        nearer = away(a) < away(b)
        low, high = np.where(nearer, low, a), np.where(nearer, b, high)
    return away(0.5 * (low + high))


def measure(flight: Flight, below: float) -> Iterator[Row]:
    """Yield a row for every pylon on every leg on which the wing comes nearer than `below`, m."""
    coarse = np.arange(flight.time[0], flight.time[-1], 0.01)
    left, right = wing(flight, coarse)
    reach = 1.5 * float(flight["V_K"].max()) * 0.01 + below
    for name, place, height, clearance in pylons(flight):
        near = distance(left, right, place, height) < reach
        for before, after in pairwise(flight.crossings):
            times = coarse[near & (coarse >= before.time - 0.01) & (coarse <= after.time)]
            if not len(times):
                continue
            fine = np.unique(np.clip(times[:, None] + np.arange(0.0, 0.01, STEP), before.time, after.time))
            away = distance(*wing(flight, fine), place, height)
            row = int(np.argmin(away))
            if away[row] < below:
                leg = f"{before.name} -> {after.name}"
                found = {"pylon": name, "north": place[0], "east": place[1], "leg": leg, "time": fine[row]}
                yield found | {"distance": away[row], "clearance": clearance}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("run", help="a stored run")
    parser.add_argument("--stage", help="the stage that is measured; by default the last one that found a flight")
    parser.add_argument("--below", type=float, default=1.0, help="the distance, m, below which a pylon is told")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    given = parser.parse_args()
    flight = airrace.open(given.run).flight(given.stage)
    rows = sorted(measure(flight, given.below), key=lambda row: float(row["time"]))
    if given.json:
        print(json.dumps(rows, indent=1))
    else:
        print(f"{flight.label}: {flight.race_time:.3f} s, {'body' if 'beta_K' in flight else 'path'}'s wing")
        for row in rows:
            short = "  TOO CLOSE" if row["distance"] < row["clearance"] - ALLOWED else ""
            place = f"({row['north']:.1f}, {row['east']:.1f})"
            away = f"{row['distance']:6.3f} m of {row['clearance']:.1f} m"
            print(f"  {row['time']:7.3f} s  {row['pylon']:8s} {place:20s} {row['leg']:24s} {away}{short}")
    sys.exit(any(row["distance"] < row["clearance"] - ALLOWED for row in rows))


if __name__ == "__main__":
    main()
