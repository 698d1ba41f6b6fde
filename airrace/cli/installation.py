"""An examination of an installation: what is there, whether it works, and what is missing for which command."""

import os
import platform
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from zoneinfo import ZoneInfo

from airrace.errors import AirraceError, StorageError
from airrace.optimal_control.native.library import library
from airrace.optimal_control.problem import Boundary, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.system import system_of
from airrace.runtime.extensions import extension_versions, installed_aircraft, load_extensions
from airrace.runtime.process import available_cores

USES = {
    "plot": "plot, check --plot, compare --plot",
    "film": "film",
    "fit": "import of FIT files",
    "design": "design",
    "parquet": "export parquet",
    "cluster": "batch --cluster",
    "pandas": "to_dataframe in Python",
    "xarray": "to_xarray in Python",
}
"""The commands and functions that need an extra."""
_REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)[^;]*(;.*extra == ['\"](?P<extra>\w+)['\"])?")


@dataclass(frozen=True)
class Component:
    """A component of an installation.

    Attributes:
        name: what it is.
        found: how it was found; empty where it is missing.
        needed_for: what cannot be done without it.
        fault: what is wrong with it; empty where nothing is.
    """

    name: str
    found: str
    needed_for: str = ""
    fault: str = ""


def examine() -> tuple[Component, ...]:
    """Return all components of this installation."""
    return (
        Component("Python", f"{platform.python_version()} on {platform.platform()}"),
        *_packages(),
        _try("native library", native_variant),
        Component("cores", f"{available_cores()} of {os.cpu_count()}"),
        _try("extensions", _extensions),
        _try("time zones", lambda: str(ZoneInfo("Europe/Zagreb")), "import --time-zone"),
        _try("this folder", lambda: _writable(Path.cwd()), "files without a folder in --output"),
        _try("temporary folder", lambda: _writable(Path(tempfile.gettempdir()))),
        _try("solver", solve_known_problem),
    )


def native_variant() -> str:
    """Return which variant of the native library is in use."""
    native = library()
    return "none: casadi evaluates, some ten times slower" if native is None else native.variant


@vector
class _Motion(Vector[T]):
    position: T = quantity("m")
    speed: T = quantity("m/s")


@vector
class _Thrust(Vector[T]):
    acceleration: T = quantity("m/s2", lower=-1.0, upper=1.0)


def solve_known_problem() -> str:
    """Solve a problem with a known answer in the solver process; return how long it took.

    A body at rest is brought to rest 1 m farther in minimum time, with at most 1 m/s2: that takes 2 s.

    Raises:
        AirraceError: the answer is another one, or the solver process died.
    """
    start_time = time.perf_counter()
    system = system_of("cart", _Motion, _Thrust, lambda x, u: _Motion(position=x.speed, speed=u.acceleration))
    within, rest = Interval(0.01, 5.0), Interval.exactly(0.0)
    target = Boundary(bounds={"position": Interval.exactly(1.0), "speed": rest})
    phases = (Phase("go", uniform(1), within), Phase("stop", uniform(1), within, target))
    start = Boundary(bounds={"position": rest, "speed": rest})
    problem = Problem(system, parameters=(), start=start, phases=phases)
    ends = (_Motion(position=0.0, speed=0.0), _Motion(position=0.4, speed=0.5), _Motion(position=1.0, speed=0.0))
    solution = solve(problem, interpolate(problem, [1.5, 0.8], corners(*ends), [0.0]))
    if not abs(solution.objective - 2.0) < 1e-5:
        raise AirraceError(f"{solution.objective:.6f} s instead of 2 s ({solution.status})")
    return f"a known answer in {time.perf_counter() - start_time:.1f} s"


def _packages() -> Iterator[Component]:
    """Yield airrace and all that it needs, also what only some commands do."""
    yield Component("airrace", version("airrace"))
    names: set[str] = set()
    for text in requires("airrace") or ():
        match = _REQUIREMENT.match(text)
        extra = match and match["extra"]
        if match is None or (extra and extra not in USES) or match["name"] in names:
            continue
        names.add(match["name"])
        try:
            yield Component(match["name"], version(match["name"]), USES[extra] if extra else "")
        except PackageNotFoundError:
            if extra:
                yield Component(match["name"], "", f"{USES[extra]}: pip install 'airrace[{extra}]'")
            elif "sys_platform" not in text:
                yield Component(match["name"], "", "", "it is not installed")


def _try(name: str, find: Callable[[], str], needed_for: str = "") -> Component:
    """Return a component that is found by trying it."""
    try:
        return Component(name, find(), needed_for)
    except Exception as error:  # whatever it is, it is what is wrong
        return Component(name, "", needed_for, str(error) or type(error).__name__)


def _extensions() -> str:
    load_extensions()
    return ", ".join((*extension_versions(), *(f"aircraft {name}" for name in installed_aircraft()))) or "none"


def _writable(folder: Path) -> str:
    try:
        with tempfile.TemporaryFile(dir=folder):
            return str(folder)
    except OSError as error:
        raise StorageError(f"{folder} takes no files: {error.strerror}") from error
