"""SI to JSBSim's units: feet, slugs, pounds of force, degrees Rankine.

The pound of force accelerates a slug by a foot per second squared, and a slug weighs as many pounds as JSBSim says.
"""

FOOT = 0.3048
"""m, exactly."""
POUND = 0.45359237
"""kg, exactly: the pound of mass."""
SLUG = 32.174049 * POUND
"""kg, with JSBSim's own ratio of slug to pound (`FGJSBBase::slugtolb`)."""
POUND_FORCE = SLUG * FOOT
"""N."""
INERTIA = SLUG * FOOT**2
"""kg m2 per slug ft2."""
TORQUE = POUND_FORCE * FOOT
"""N m per lbf ft; also W per ft lbf/s."""
DENSITY = SLUG / FOOT**3
"""kg/m3 per slug/ft3."""
PRESSURE = POUND_FORCE / FOOT**2
"""Pa per lbf/ft2."""
RANKINE = 5.0 / 9.0
"""K."""
