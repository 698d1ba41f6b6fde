"""The histories that a flight may have besides the states and controls of a model: names, units and meanings.

Flights of every source use these names. Angles are in radians; headings count clockwise from north.
"""

from airrace.quantities import Quantity

_DECLARED = (
    Quantity("z", "m", text="below the track's origin"),
    Quantity("height", "m", text="height above the track's origin"),
    Quantity("altitude", "m", text="height above mean sea level"),
    Quantity("latitude", "rad", text="geodetic latitude, WGS 84"),
    Quantity("longitude", "rad", text="geodetic longitude, WGS 84"),
    Quantity("V_K", "m/s", text="kinematic speed: along the flight path, relative to the ground"),
    Quantity("V_A", "m/s", text="true airspeed"),
    Quantity("V_I", "m/s", text="indicated airspeed of an instrument without errors (calibrated airspeed)"),
    Quantity("V_G", "m/s", text="speed over ground, its horizontal part"),
    Quantity("chi", "rad", text="course over ground"),
    Quantity("gamma", "rad", text="climb angle"),
    Quantity("mu", "rad", text="kinematic bank angle, right wing down"),
    Quantity("alpha_A", "rad", text="angle of attack"),
    Quantity("psi", "rad", text="heading of the body"),
    Quantity("theta", "rad", text="pitch angle of the body"),
    Quantity("phi", "rad", text="roll angle of the body"),
    Quantity("b0", "1", text="attitude of the body in the north-east-down frame, scalar part"),
    Quantity("b1", "1", text="attitude of the body, north part"),
    Quantity("b2", "1", text="attitude of the body, east part"),
    Quantity("b3", "1", text="attitude of the body, down part"),
    Quantity("h_E", "m", text="energy height, height + V_K^2 / (2 g0)"),
)

GLOSSARY = {one.name: one for one in _DECLARED}
"""Declarations of the derived histories, by name."""

PATH_ATTITUDE = ("q0", "q1", "q2", "q3")
"""The quaternion of the flight-path frame Kbar, scalar first."""
BODY_ATTITUDE = ("b0", "b1", "b2", "b3")
"""The quaternion of the body, scalar first."""
