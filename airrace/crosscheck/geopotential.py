"""The height at which JSBSim's atmosphere is as dense as ours.

Both are ISA. Ours falls with the height h itself; JSBSim's with the geopotential height `R h / (R + h)`, for the
standard was written for a gravity that weakens with height. At 1000 m that is 0.16 m, or 1.5e-5 of the density. The
rest, 2.7e-6, is in the digits of the gas constant.
"""

import dataclasses

from airrace.dynamics.six_dof import SixDofState
from airrace.environment.atmosphere import AtmosphereParameters

EARTH_RADIUS = 6356766.0
"""The Earth's radius in the definition of the geopotential height, m [ISO 2533]."""


def geopotential_height(h: float) -> float:
    """Return the height (m) at which constant gravity gives the potential that h (m above sea level) has."""
    return EARTH_RADIUS * h / (EARTH_RADIUS + h)


def at_geopotential_height(state: SixDofState[float], air: AtmosphereParameters[float]) -> SixDofState[float]:
    """Return the state moved down to where our density is that of JSBSim."""
    return dataclasses.replace(state, z=air.elevation - geopotential_height(air.elevation - state.z))
