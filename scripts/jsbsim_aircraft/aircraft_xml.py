"""The file of an aircraft and its planet as a JSBSim model.

Every coefficient is a property of its own name, `airrace/C_malpha`, and every formula refers to it, so the file reads
like the equations. JSBSim's conventions meet ours as follows:

- Body axes (x forward, y right, z down), the moments' signs and `[-D, Y, -L]` in wind axes are the same.
- The centre of gravity is the origin of its structural axes and the reference point of the air's moments.
- Deflections are properties of ours (`airrace/eta` and so on, rad): a positive one makes a negative moment.
- Lengths in feet: span for p, r and the moments about x and z, chord for q, the rate of alpha and the moment about y.
- `aero/alphadot-rad_sec` follows the motion over the ground, as `alpha_K'` does; in flight it lags by one step.
- Thrust is an external force along x_B. Its formula is ours, for JSBSim's piston engines and propellers are other
  models; airspeed and density in it are JSBSim's.
- The product of inertia has the sign of `-I_xz` in the matrix: `negated_crossproduct_inertia` is false.

JSBSim's Earth is the ellipsoid WGS84 with gravity of second order (J2), and it turns: angular accelerations differ by
up to 5e-4 rad/s2 (its own rate of 7e-5 rad/s, times a roll rate), and a second's flight by some millimetres. The flat
one is a sphere that does not turn, so large that neither its curvature nor the decrease of gravity with height shows;
its ground has the gravity `g0`.

The pound of force accelerates a slug by a foot per second squared, and a slug weighs as many pounds as JSBSim says.

A term is a number, the name of a property, or a formula.
"""

from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, indent

from airrace.model.aircraft import InnerLoopParameters
from airrace.model.dynamics.aerodynamics import STALL_BLEND
from airrace.model.environment import RHO_ISA, g0
from airrace.optimal_control.quantities import FOOT

POUND = 0.45359237
"""The pound of mass, kg, exactly."""
SLUG = 32.174049 * POUND
"""The slug, kg, with JSBSim's own ratio of slug to pound (`FGJSBBase::slugtolb`)."""
POUND_FORCE = SLUG * FOOT
"""The pound of force, N."""
INERTIA = SLUG * FOOT**2
"""The unit of moments of inertia, slug ft2, in kg m2."""
TORQUE = POUND_FORCE * FOOT
"""The unit of torques, lbf ft, in N m; also that of power, ft lbf/s, in W."""
DENSITY = SLUG / FOOT**3
"""The unit of density, slug/ft3, in kg/m3."""
PRESSURE = POUND_FORCE / FOOT**2
"""The unit of pressure, lbf/ft2, in Pa."""
RANKINE = 5.0 / 9.0
"""The degree Rankine, K."""


Term = float | str | Element


def formula(kind: str, *terms: Term) -> Element:
    """Return one operation, e.g. `sum`, `product`, `quotient`, `difference`, `pow`, `sqrt`."""
    element = Element(kind)
    element.extend(_operand(term) for term in terms)
    return element


def element(tag: str, *children: Element, text: str | None = None, **attributes: str) -> Element:
    """Return an element with children, text and attributes."""
    made = Element(tag, attributes)
    made.text = text
    made.extend(children)
    return made


def square(term: Term) -> Element:
    """Return the term times itself."""
    return formula("pow", term, 2.0)


def smooth_clip(term: Term, lower: Term, upper: Term, width: float) -> Element:
    """Return the term rounded off at two limits, as `airrace.model.frames.smooth_clip` does."""

    def distance(limit: Term) -> Element:
        return formula("sqrt", formula("sum", square(formula("difference", term, limit)), width * width))

    return formula(
        "product", 0.5, formula("difference", formula("sum", lower, upper, distance(lower)), distance(upper))
    )


def _operand(term: Term) -> Element:
    if isinstance(term, Element):
        return term
    if isinstance(term, str):
        return element("property", text=term)
    return element("value", text=repr(float(term)))  # repr gives a number that reads back exactly


@dataclass(frozen=True)
class Planet:
    """A planet: its name, whether it is JSBSim's own Earth, and the geodetic `latitude` (rad) of the flights."""

    name: str
    turning: bool
    latitude: float


EARTH = Planet("WGS84", turning=True, latitude=0.7941)  # 45.5 degrees, where gravity on the rotating Earth is g0
FLAT = Planet("flat", turning=False, latitude=0.0)


NAME = "airrace"
MOVED = ("eta", "xi", "zeta", "delta_T")
"""The deflections (rad) and the throttle: properties `airrace/...` that are set from outside."""
ALPHA, BETA, V_A = "aero/alpha-rad", "aero/beta-rad", "velocities/vt-fps"
SPAN, CHORD = "metrics/bw-ft", "metrics/cbarw-ft"
SIDEWAYS = {"beta": BETA, "p": "airrace/p_star", "r": "airrace/r_star", "xi": "airrace/xi", "zeta": "airrace/zeta"}
"""The properties that the lateral derivatives multiply."""


def write_model(folder: Path, aircraft: InnerLoopParameters[float], planet: Planet) -> Path:
    """Write the model where JSBSim looks for it, `folder/airrace/airrace.xml`, and return that path."""
    path = folder / NAME / f"{NAME}.xml"
    path.parent.mkdir(parents=True, exist_ok=True)
    root = element(
        "fdm_config",
        element("fileheader", element("description", text="Written by airrace from its aircraft's numbers.")),
        *([] if planet.turning else [_flat_planet(planet)]),
        *_body(aircraft),
        _thrust(),
        _aerodynamics(aircraft),
        name=NAME,
        version="2.0",
    )
    indent(root)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    return path


def _flat_planet(planet: Planet) -> Element:
    # A radius of 1e9 m is flat: positions still resolve 1e-7 m, and gravity falls by 2e-6 over 1000 m.
    radius, gravity = 1e9 / FOOT, g0 / FOOT
    return element(
        "planet",
        _quantity("semimajor_axis", radius, "FT"),
        _quantity("semiminor_axis", radius, "FT"),
        _quantity("rotation_rate", 0.0, "RAD/SEC"),
        _quantity("GM", gravity * radius * radius, "FT3/SEC2"),
        element("J2", text="0.0"),
        name=planet.name,
    )


def _own(name: str) -> str:
    return f"{NAME}/{name}"


def _quantity(tag: str, value: float, unit: str) -> Element:
    return element(tag, text=repr(value), unit=unit)


def _origin(**attributes: str) -> Element:
    return element("location", *(element(axis, text="0.0") for axis in "xyz"), unit="IN", **attributes)


def _body(aircraft: InnerLoopParameters[float]) -> list[Element]:
    """Return sizes and masses, and the parts that JSBSim asks for and that are empty."""
    inertia = {"ixx": aircraft.I_x, "iyy": aircraft.I_y, "izz": aircraft.I_z, "ixz": aircraft.I_xz}
    return [
        element(
            "metrics",
            _quantity("wingarea", aircraft.S / FOOT**2, "FT2"),
            _quantity("wingspan", aircraft.b / FOOT, "FT"),
            _quantity("chord", aircraft.cbar / FOOT, "FT"),
            *(_origin(name=name) for name in ("AERORP", "EYEPOINT", "VRP")),
        ),
        element(
            "mass_balance",
            *(_quantity(tag, value / INERTIA, "SLUG*FT2") for tag, value in inertia.items()),
            _quantity("emptywt", aircraft.m / POUND, "LBS"),
            _origin(name="CG"),
            negated_crossproduct_inertia="false",
        ),
        element("ground_reactions"),
        element("propulsion"),
        element("flight_control", name=NAME),
    ]


def _thrust() -> Element:
    """Return the thrust `T = delta_T P sigma_P / sqrt(V_A^2 + V_s^2)` along x_B, as an external force."""
    power = formula("product", _own("delta_T"), _own("P"), _own("sigma_P"))
    speed = formula("sqrt", formula("sum", square(V_A), square(_own("V_s"))))
    forward = element("direction", element("x", text="1"), element("y", text="0"), element("z", text="0"))
    pull = element("function", formula("quotient", power, speed))
    force = element("force", pull, _origin(), forward, name="thrust", frame="BODY", unit="LBS")
    return element("external_reactions", *_properties(dict.fromkeys(MOVED, 0.0)), force)


def _properties(numbers: dict[str, float]) -> list[Element]:
    return [element("property", text=_own(name), value=repr(value)) for name, value in numbers.items()]


def _aerodynamics(aircraft: InnerLoopParameters[float]) -> Element:
    """Return the coefficients, the formulas that several axes share in the order of their evaluation, and the axes."""
    # every coefficient but C_Y_trim, which is the point mass's alone, and the numbers with a unit in JSBSim's units
    coefficients = [name for name in aircraft.names() if name == "k" or (name.startswith("C_") and name != "C_Y_trim")]
    numbers = {name: getattr(aircraft, name) for name in coefficients}
    units = {"P": TORQUE, "V_s": FOOT, "h_P": TORQUE, "Q_P": TORQUE}
    numbers |= {name: getattr(aircraft, name) / unit for name, unit in units.items()}

    wing = formula("sum", _own("C_L0"), formula("product", _own("C_Lalpha"), ALPHA))
    rounded = smooth_clip(_own("C_L_linear"), _own("C_L_min"), _own("C_L_max"), STALL_BLEND)
    lift = formula("sum", rounded, *_terms({"C_Lq": _own("q_star"), "C_Leta": _own("eta")}))
    induced = formula("product", _own("k"), square(formula("difference", _own("C_L"), _own("C_L_minD"))))
    slipping = formula("product", _own("C_Dbeta2"), square(BETA))
    relative = formula("product", 1.132, formula("quotient", "atmosphere/rho-slugs_ft3", RHO_ISA / DENSITY))
    shared = {
        "p_star": _dimensionless("velocities/p-aero-rad_sec", SPAN),
        "q_star": _dimensionless("velocities/q-aero-rad_sec", CHORD),
        "r_star": _dimensionless("velocities/r-aero-rad_sec", SPAN),
        "alphadot_star": _dimensionless("aero/alphadot-rad_sec", CHORD),
        "C_L_linear": wing,
        "C_L": lift,
        "C_D": formula("sum", _own("C_D0"), induced, slipping),
        "sigma_P": formula("difference", relative, 0.132),
    }

    rolling = formula("product", _own("C_lr_per_C_L"), _own("C_L"), _own("r_star"))
    yawing = formula("product", _own("C_np_per_C_L"), _own("C_L"), _own("p_star"))
    pitching = {
        "C_malpha": ALPHA,
        "C_mq": _own("q_star"),
        "C_malphadot": _own("alphadot_star"),
        "C_meta": _own("eta"),
    }
    engine = formula("product", -1.0, _own("delta_T"), _own("sigma_P"), _own("Q_P"))
    axes = {
        "DRAG": [_load(_own("C_D"))],
        "SIDE": [_load(_lateral("C_Y"))],
        "LIFT": [_load(_own("C_L"))],
        "ROLL": [_load(_lateral("C_l", rolling), SPAN), engine],
        "PITCH": [
            _load(formula("sum", _own("C_m0"), *_terms(pitching)), CHORD),
            formula("product", -1.0, _own("h_P"), "velocities/r-rad_sec"),
        ],
        "YAW": [
            _load(_lateral("C_n", yawing), SPAN),
            formula("product", _own("h_P"), "velocities/q-rad_sec"),
        ],
    }
    return element(
        "aerodynamics",
        *_properties(numbers),
        *(element("function", value, name=_own(name)) for name, value in shared.items()),
        *(
            element(
                "axis",
                *(
                    element("function", part, name=_own(f"{name.lower()}_{number}"))
                    for number, part in enumerate(parts, start=1)
                ),
                name=name,
            )
            for name, parts in axes.items()
        ),
    )


def _dimensionless(rate: str, length: str) -> Element:
    return formula("quotient", formula("product", rate, length), formula("product", 2.0, V_A))


def _terms(derivatives: dict[str, str]) -> list[Element]:
    return [formula("product", _own(name), variable) for name, variable in derivatives.items()]


def _lateral(coefficient: str, *further: Element) -> Element:
    terms = _terms({coefficient + name: variable for name, variable in SIDEWAYS.items()})
    return formula("sum", *terms, *further)


def _load(coefficient: Term, *length: str) -> Element:
    """Return the formula of a force (lbf), or with a reference length of a moment (lbf ft)."""
    return formula("product", "aero/qbar-psf", "metrics/Sw-sqft", *length, coefficient)
