"""Our aircraft in JSBSim: a state of the six-dof model is put in, and its motion is read back in our units.

    R_OB = R_OKbar R_BKbar^T        V_B = R_BKbar V_K e_x

O is the local frame where the flight begins; JSBSim measures the way from there in the plane that touches its sea
level.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from airrace.crosscheck.aircraft_xml import MOVED, NAME, write_model
from airrace.crosscheck.planet import Planet
from airrace.crosscheck.simulator import Simulator
from airrace.crosscheck.units import DENSITY, FOOT, POUND_FORCE, PRESSURE, RANKINE, SLUG
from airrace.dynamics.attitude import rotation_to_body
from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.dynamics.six_dof import SixDofState
from airrace.environment.atmosphere import T_ISA, AtmosphereParameters, density
from airrace.frames import angles, rotation
from airrace.records import record
from airrace.trajectory import Array

STEP = 1e-3
"""The step of JSBSim's integration, s."""


@record
class Accelerations:
    """The specific force (what accelerometers read, m/s2) and the angular acceleration (rad/s2).

    Both are in body axes, shape (3,).
    """

    specific_force: Array
    angular: Array


def body_attitude(state: SixDofState[float]) -> Array:
    """Return the attitude `R_OB` of a state, shape (3, 3)."""
    return np.array(rotation(state.q)) @ np.array(rotation_to_body(state.alpha_K, state.beta_K), dtype=np.float64).T


@record
class Flown:
    """An aircraft flown by JSBSim in still air.

    Attributes:
        simulator: JSBSim with the aircraft loaded.
        atmosphere: the atmosphere of the day.
        own_density: whether JSBSim's atmosphere makes the density; else it is ours where the flight starts, and stays.
    """

    simulator: Simulator
    atmosphere: AtmosphereParameters[float]
    own_density: bool = True

    def start(self, state: SixDofState[float]) -> None:
        """Put the aircraft into a state, deflections and lever included; its north and east are ignored."""
        self.control({name: getattr(state, name) for name in MOVED})
        if not self.own_density:
            self.simulator["atmosphere/override/density"] = density(state.z, self.atmosphere) / DENSITY
        psi, theta, phi = angles(body_attitude(state).tolist())
        u, v, w = state.V_K * np.array(rotation_to_body(state.alpha_K, state.beta_K), dtype=np.float64)[:, 0]
        initial = [("h-sl-ft", (self.atmosphere.elevation - state.z) / FOOT)]
        # JSBSim reads the other angles back from the attitude, so the one that may be vertical comes last
        initial += [("theta-rad", 0.0), ("phi-rad", phi), ("psi-true-rad", psi), ("theta-rad", theta)]
        initial += [("u-fps", u / FOOT), ("v-fps", v / FOOT), ("w-fps", w / FOOT)]
        initial += [("p-rad_sec", state.p_K), ("q-rad_sec", state.q_K), ("r-rad_sec", state.r_K)]
        for name, value in initial:
            self.simulator[f"ic/{name}"] = float(value)
        self.simulator.restart()

    def control(self, moved: Mapping[str, float]) -> None:
        """Set deflections (rad) and power lever by name."""
        for name, value in moved.items():
            self.simulator[f"{NAME}/{name}"] = value

    def advance(self) -> None:
        """Advance the flight by one step."""
        self.simulator.advance()

    def accelerations(self) -> Accelerations:
        """Return the accelerations that the present forces and moments cause."""
        mass = self.simulator["inertia/mass-slugs"] * SLUG
        force = np.array([self.simulator[f"forces/fb{axis}-total-lbs"] for axis in "xyz"]) * POUND_FORCE
        angular = np.array([self.simulator[f"accelerations/{axis}dot-rad_sec2"] for axis in "pqr"])
        return Accelerations(force / mass, angular)

    def density(self) -> float:
        """Return the density of the air, kg/m3."""
        return self.simulator["atmosphere/rho-slugs_ft3"] * DENSITY

    def position(self) -> Array:
        """Return north and east of the start and down from the track's origin, m; shape (3,)."""
        north, east, up = (self.simulator[f"position/from-start-neu-{axis}-ft"] * FOOT for axis in "neu")
        return np.array([north, east, self.atmosphere.elevation - up])

    def attitude(self) -> Array:
        """Return the attitude `R_OB`, shape (3, 3)."""
        return self.simulator.attitude()


def flown_by_jsbsim(
    folder: Path,
    aircraft: InnerLoopParameters[float],
    atmosphere: AtmosphereParameters[float],
    planet: Planet,
    *,
    own_density: bool = True,
) -> Flown:
    """Write the model into the folder and load it.

    Args:
        folder: receives the model.
        aircraft: its numbers.
        atmosphere: the atmosphere of the day; there is no wind.
        planet: what it flies over.
        own_density: see `Flown`.

    Raises:
        UsageError: JSBSim does not take the model.
    """
    write_model(folder, aircraft, planet)
    return loaded(folder, atmosphere, planet, own_density=own_density)


def loaded(folder: Path, atmosphere: AtmosphereParameters[float], planet: Planet, *, own_density: bool = True) -> Flown:
    """Load the model that is in the folder, as it stands there. Arguments and errors are those of `flown_by_jsbsim`."""
    simulator = Simulator(folder, STEP)
    simulator["atmosphere/delta-T"] = (atmosphere.T_0 - T_ISA) / RANKINE
    simulator["atmosphere/P-sl-psf"] = atmosphere.p_0 / PRESSURE
    simulator["ic/lat-geod-rad"] = planet.latitude
    return Flown(simulator, atmosphere, own_density)
