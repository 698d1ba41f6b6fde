"""Factors from JSBSim's units to SI: feet, slugs, pounds of force, degrees Rankine.

The pound of force accelerates a slug by a foot per second squared, and a slug weighs as many pounds as JSBSim says.
"""

FOOT = 0.3048
"""The foot, m, exactly."""
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
