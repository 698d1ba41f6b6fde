"""Mass, size and control travels of an aircraft of JSBSim.

The mass is that of the empty aircraft, point masses and the contents of tanks; moments of inertia are about their
common centre of mass, in body axes (forward, right, down). JSBSim has those of the empty aircraft about its own centre.
"""

import math
from collections.abc import Mapping
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from airrace.files.inputs.jsbsim.document import AREA, INERTIA, LENGTH, MASS, PLAIN, JsbsimDocument
from airrace.model.aircraft import Airframe
from airrace.optimal_control.trajectory import Array

Surface = Literal["eta", "xi", "zeta"]
SURFACES: Mapping[Surface, str] = {"eta": "elevator", "xi": "left-aileron", "zeta": "rudder"}
"""The control surfaces by JSBSim's names; the right aileron goes the other way."""
BODY = np.array([-1.0, 1.0, -1.0])
"""From structural axes (back, right, up) to body axes."""


def read_airframe(document: JsbsimDocument) -> tuple[Airframe, Array]:
    """Return mass and size, and the arm from the centre of mass to the aerodynamic reference point in body axes, m.

    Raises:
        InputError: something is missing, or no number.
    """
    metrics, balance = document.section("metrics"), document.section("mass_balance")
    places = [_location(balance, balance.root, "CG")]
    masses = [balance.measure(balance.root, "emptywt", MASS)]
    for point in balance.root.findall("pointmass"):
        places.append(_location(balance, point))
        masses.append(balance.measure(point, "weight", MASS))
    if document.root.find("propulsion") is not None:
        propulsion = document.section("propulsion")
        for tank in propulsion.root.findall("tank"):
            places.append(_location(propulsion, tank))
            masses.append(propulsion.measure(tank, "contents", MASS, 0.0))
    m = sum(masses)
    S, b, cbar = (
        metrics.measure(metrics.root, "wingarea", AREA),
        *(metrics.measure(metrics.root, name, LENGTH) for name in ("wingspan", "chord")),
    )
    if min(m, S, b, cbar) <= 0.0:
        document.refuse(document.root, "must have a mass, wingarea, wingspan and chord above 0")
    mean = np.array(masses) @ np.array(places) / m
    inertia = _own_inertia(balance)
    for mass, place in zip(masses, places, strict=True):
        x = BODY * (place - mean)
        inertia += mass * (x @ x * np.eye(3) - np.outer(x, x))
    I_x, I_y, I_z = np.diag(inertia).tolist()
    airframe = Airframe(m, S, b, cbar, I_x, I_y, I_z, -float(inertia[0, 2]))
    return airframe, BODY * (_location(metrics, metrics.root, "AERORP") - mean)


def _location(document: JsbsimDocument, parent: Element, name: str | None = None) -> Array:
    locations = [place for place in parent.findall("location") if name is None or place.get("name") == name]
    if not locations:
        document.refuse(parent, "has no <location>" if name is None else f'has no <location name="{name}">')
    return np.array(document.place_of(locations[0]))


def _own_inertia(balance: JsbsimDocument) -> Array:
    """Return the matrix of inertia of the empty aircraft, kg m2.

    JSBSim's products of inertia are entries of the matrix (`-I_xz`) unless the file says that they are not negated.
    """
    inertia = np.diag([balance.measure(balance.root, name, INERTIA) for name in ("ixx", "iyy", "izz")])
    entry = balance.measure(balance.root, "ixz", INERTIA, 0.0)
    entry *= -1.0 if balance.root.get("negated_crossproduct_inertia") == "false" else 1.0
    inertia[0, 2] = inertia[2, 0] = entry
    return inertia


def read_travels(document: JsbsimDocument, defaults: Mapping[Surface, float]) -> tuple[dict[Surface, float], list[str]]:
    """Return the travels of the control surfaces (rad) from the ranges of JSBSim's flight control, and remarks.

    Both ways a surface goes as far as the shorter of its two; where there is no range it has the default.
    """
    travels, remarks = dict(defaults), list[str]()
    control = document if document.root.find("flight_control") is None else document.section("flight_control")
    for surface, name in SURFACES.items():
        ends = [0.0]
        for scale in control.root.iter("aerosurface_scale"):
            span = scale.find("range")
            if span is not None and (scale.findtext("output") or "").strip() == f"fcs/{name}-pos-rad":
                gain = control.measure(scale, "gain", PLAIN, 1.0)
                ends = [abs(gain * control.measure(span, end, PLAIN)) for end in ("min", "max")]
        far, near = math.degrees(max(ends)), math.degrees(min(ends))
        if near == 0.0:
            remarks.append(f"{name}: <flight_control> has no range of fcs/{name}-pos-rad; its travel is the template's")
        else:
            travels[surface] = min(ends)
        if 0.0 < near < 0.999 * far:
            remarks.append(
                f"{name}: goes {far:.3g} deg to one side and {near:.3g} deg to the other; taken is {near:.3g}"
            )
    return travels, remarks
