"""The integrator DOP853 of scipy, without the rest of `scipy.integrate`.

To load that package takes 0.4 s, more than many solves of a short race: it fetches quadrature, optimisation and
transforms of signals. The integrator itself stands in a folder of its own, whose files need nothing but `scipy.sparse`.
Loaded under another name, without the package around them, they take half of that time.
"""

import importlib
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

ALIAS = "airrace_scipy_integrators"
"""The name under which the folder of integrators is loaded."""
FOLDER = Path("integrate", "_ivp")
"""The folder of the integrators in scipy, since its version 1.0."""


@cache
def dop853() -> Any:  # Any: untyped in scipy
    """Return scipy's class `DOP853`: from its own file, or from `scipy.integrate` where that file is elsewhere."""
    try:
        return importlib.import_module(f"{_package()}.rk").DOP853
    except (ImportError, AttributeError):
        return importlib.import_module("scipy.integrate").DOP853


def _package() -> str:
    """Return the name of a package whose modules are scipy's files of integrators."""
    scipy = find_spec("scipy")
    if scipy is None or scipy.submodule_search_locations is None:
        raise ImportError("scipy is no package")
    package = ModuleType(ALIAS)
    package.__path__ = [str(Path(folder, FOLDER)) for folder in scipy.submodule_search_locations]
    sys.modules.setdefault(ALIAS, package)
    return ALIAS
