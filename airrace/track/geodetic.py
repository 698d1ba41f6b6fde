"""Conversions between latitude and longitude (WGS 84) and metres in the flat frame of a track.

A place is taken at the elevation of the track's origin and seen in the origin's local north-east-down frame; how far
it lies below that frame's horizontal plane, for the earth is round, is ignored: the track's frame is flat. Heights of
the track's frame are added to the origin's elevation.
"""

from typing import cast

import numpy as np

from airrace.track.course import Origin
from airrace.trajectory import Array


def metres(latitude: Array, longitude: Array, origin: Origin) -> tuple[Array, Array, Array]:
    """Return north, east and down (m) of places (rad) at the elevation of the origin, each of shape (n,).

    Raises:
        ValueError: the origin has no latitude and longitude.
    """
    # Imported here: most courses are given in metres. ignore: the library leaves its arguments untyped.
    from pymap3d import geodetic2ned  # pyright: ignore[reportUnknownVariableType]

    phi, lam, h = _coordinates(origin)
    return cast(tuple[Array, Array, Array], geodetic2ned(latitude, longitude, h, phi, lam, h, deg=False))


def geodetic(north: Array, east: Array, origin: Origin) -> tuple[Array, Array]:
    """Return latitude and longitude (rad) of places (m), each of shape (n,): the inverse of `metres` without its down.

    Raises:
        ValueError: the origin has no latitude and longitude.
    """
    from pymap3d import ned2geodetic  # pyright: ignore[reportUnknownVariableType]

    phi, lam, h = _coordinates(origin)
    # The place is at the origin's elevation: its depth below the plane is found in two corrections.
    down = np.zeros_like(north)
    for _ in range(2):
        place = cast(tuple[Array, Array, Array], ned2geodetic(north, east, down, phi, lam, h, deg=False))
        down = down + np.reshape(place[2] - h, north.shape)
    place = cast(tuple[Array, Array, Array], ned2geodetic(north, east, down, phi, lam, h, deg=False))
    return np.reshape(place[0], north.shape), np.reshape(place[1], north.shape)


def _coordinates(origin: Origin) -> tuple[float, float, float]:
    if origin.latitude is None or origin.longitude is None:
        raise ValueError("the track's origin has no latitude and longitude")
    return origin.latitude, origin.longitude, origin.elevation
