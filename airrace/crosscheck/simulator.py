"""JSBSim itself, in its own units; see `flown.py` for ours. This is the only file that calls it."""

import warnings
from pathlib import Path

import numpy as np

from airrace.crosscheck.aircraft_xml import NAME
from airrace.errors import UsageError
from airrace.trajectory import Array

ADAMS_BASHFORTH_3, BUSS_2 = 4.0, 7.0
"""JSBSim's numbers of its integrators: third order with a memory; second order on the sphere of the quaternions."""
INTEGRATORS = {
    "rate/rotational": ADAMS_BASHFORTH_3,
    "rate/translational": ADAMS_BASHFORTH_3,
    "position/rotational": BUSS_2,
    "position/translational": ADAMS_BASHFORTH_3,
}


class Simulator:
    """A simulation of one aircraft over one planet.

    Properties are read and set by their names, `simulator["aero/alpha-rad"]`.
    """

    def __init__(self, folder: Path, step: float) -> None:
        """Load the model that `write_model` wrote into the folder; `step` of the integration in s.

        Raises:
            UsageError: JSBSim is not installed, or does not take the model.
        """
        try:
            import jsbsim
        except ImportError as error:
            raise UsageError("JSBSim is not installed; it comes with the extra `crosscheck` of airrace") from error
        jsbsim.FGJSBBase().debug_lvl = 0
        self._jsbsim = jsbsim.FGFDMExec(None)
        self._jsbsim.set_debug_level(0)
        if not self._jsbsim.load_model_with_paths(NAME, str(folder), str(folder), str(folder)):
            raise UsageError(f"JSBSim does not take the model in {folder}")
        self._jsbsim.set_dt(step)
        for name, kind in INTEGRATORS.items():
            self[f"simulation/integrator/{name}"] = kind

    def __getitem__(self, name: str) -> float:
        return self._jsbsim[name]

    def __setitem__(self, name: str, value: float) -> None:
        self._jsbsim[name] = value

    def restart(self) -> None:
        """Begin anew from the initial conditions, the properties `ic/...`."""
        self._jsbsim.run_ic()

    def advance(self) -> None:
        """Advance by one step: first the state with the earlier rates, then the rates with the present controls."""
        self._jsbsim.run()

    def attitude(self) -> Array:
        """Return the attitude `R_OB`, shape (3, 3)."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PendingDeprecationWarning)  # JSBSim's own use of numpy.matrix
            return np.asarray(self._jsbsim.get_propagate().get_Tl2b(), dtype=np.float64).T
