"""The functions of one shooting interval and their derivatives: generated once per system, compiled, cached.

Every kernel maps `(y, own, shared)` to values c, with y the unknowns, `own` what differs from call to call and `shared`
what does not:

    step: y = (x, u, T), own = the interval's share of the duration T, shared = p    -> x at the interval's end
    path: y = (x, u), own empty, shared = p                                          -> path quantities

Compiled, the step's derivatives are composed from those of its stages, see `step_kernel.py`; all else is the graph that
casadi makes. A library is kept per machine, named by a hash of all it depends on. Without a C compiler casadi's own
virtual machine evaluates the graphs, the step's among them, slower.
"""

import hashlib
import logging
import platform
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca

from airrace.errors import KernelError
from airrace.optimal_control import background_compilation, kernel_library
from airrace.optimal_control.kernel_library import Source, generated_source
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.step_kernel import driver_text, step_sources
from airrace.system import Observation, System

logger = logging.getLogger(__name__)

DRIVER_FLAGS = ("-O3",)
"""Flags for the driver's loops over sensitivities, which then run a third faster than with -O2."""

FORMAT = 3
"""Number of the form of the generated code; it changes with that, so that no cached library of another form is used."""


@dataclass(frozen=True)
class Kernel:
    """A function and its derivatives in y, shapes (n_y,), (n_own,), (n_shared,) -> (n_c,).

    Attributes:
        value: (y, own, shared) -> c.
        jacobian: (y, own, shared) -> c, dc/dy.
        hessian: (y, own, shared, lam) -> gradient (n_y,) and upper triangle of the Hessian of lam . c.
    """

    value: ca.Function
    jacobian: ca.Function
    hessian: ca.Function


@dataclass(frozen=True)
class Kernels:
    """The kernels of a system; `path` is None for a system without path quantities."""

    step: Kernel
    path: Kernel | None
    compiled: bool


def differentiate(name: str, y: ca.SX, own: ca.SX, shared: ca.SX, c: ca.SX) -> dict[str, ca.Function]:
    """The functions of a kernel by their names `name`, `name_jacobian`, `name_hessian`."""
    lam = ca.SX.sym("lam", c.numel())
    hessian, gradient = ca.hessian(ca.dot(lam, c), y)
    arguments = [y, own, shared]
    functions = [
        ca.Function(name, arguments, [ca.densify(c)]),
        ca.Function(f"{name}_jacobian", arguments, [ca.densify(c), ca.jacobian(c, y)]),
        ca.Function(f"{name}_hessian", [*arguments, lam], [ca.densify(gradient), ca.triu(hessian)]),
    ]
    return {function.name(): function for function in functions}


def observation_kernel(observation: Observation, states: int) -> Kernel:
    """Kernel of what is observed at a boundary: y = x, own = the boundary's values, nothing shared."""
    x, values, nothing = ca.SX.sym("x", states), ca.SX.sym("b", len(observation.parameters)), ca.SX.sym("none", 0)
    functions = differentiate("observe", x, values, nothing, observation.values(x, values))
    return _kernel("observe", functions.__getitem__)


def build_kernels(system: System, scheme: RungeKutta, *, compiled: bool) -> Kernels:
    """Kernels of a system; compiled if wanted and possible, from the cache where it has them."""
    with_path = system.path_values is not None
    if compiled:
        try:
            return _load(compile_kernels(system, scheme), with_path=with_path)
        except KernelError as error:
            logger.warning("no compiled kernels, evaluating in casadi's virtual machine: %s", error)
    return _assemble(symbolic_kernels(system, scheme).__getitem__, with_path=with_path, compiled=False)


def compile_kernels(system: System, scheme: RungeKutta) -> Path:
    """The compiled library of a system, built unless the cache has it whole.

    Raises:
        KernelError: it cannot be built.
    """
    library = _library(system, scheme)
    background_compilation.finish(library)
    if not kernel_library.is_intact(library):
        kernel_library.compile_library(_sources(system, scheme), library)
    return library


def needs_compiling(system: System, scheme: RungeKutta) -> bool:
    """Whether the kernels have yet to be compiled, by a compiler that is there."""
    try:
        kernel_library.find_compiler()
    except KernelError:
        return False
    return not kernel_library.is_intact(_library(system, scheme))


def prepare(system: System, scheme: RungeKutta) -> bool:
    """Compile the kernels in the background if they need it, and tell whether; `build_kernels` waits where it must."""
    needed = needs_compiling(system, scheme)
    if needed:
        background_compilation.start(_library(system, scheme), system, scheme)
    return needed


def finish_preparing(system: System, scheme: RungeKutta, on_wait: Callable[[], None]) -> None:
    """Let what this process compiles in the background for a system be done, for another process to load.

    Args:
        on_wait: called if it takes a while.
    """
    library = _library(system, scheme)
    if background_compilation.under_way(library):
        on_wait()
    background_compilation.finish(library)


def symbolic_kernels(system: System, scheme: RungeKutta) -> dict[str, ca.Function]:
    """All kernel functions as SX graphs, by name."""
    y, fraction, p = _arguments(system)
    return differentiate("step", y, fraction, p, _end(system, scheme, y, fraction, p)) | _path_functions(system)


def _sources(system: System, scheme: RungeKutta) -> list[Source]:
    """What is compiled: the functions of `symbolic_kernels`, the derivatives of the step composed."""
    arguments = _arguments(system)
    step = ca.Function("step", [*arguments], [ca.densify(_end(system, scheme, *arguments))], {"cse": True})
    composed = step_sources(system, scheme)
    return [
        *(generated_source(function, hidden=True) for function in composed.generated),
        Source("step_kernel", composed.driver, DRIVER_FLAGS),
        *(generated_source(function) for function in (step, *_path_functions(system).values())),
    ]


def _arguments(system: System) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Symbols of y = (x, u, T), the interval's share of T, and p."""
    y = ca.SX.sym("y", len(system.states) + len(system.controls) + 1)
    return y, ca.SX.sym("fraction"), ca.SX.sym("p", len(system.parameters))


def _end(system: System, scheme: RungeKutta, y: ca.SX, fraction: ca.SX, p: ca.SX) -> ca.SX:
    """The state at the interval's end."""
    n_x = len(system.states)
    x_next: ca.SX = scheme.advance(system.rates, y[:n_x], y[n_x:-1], p, y[-1] * fraction)
    return x_next if system.projection is None else system.projection(x_next)


def _path_functions(system: System) -> dict[str, ca.Function]:
    if system.path_values is None:
        return {}
    y, _, p = _arguments(system)
    n_x, both = len(system.states), y[:-1]
    values = system.path_values(both[:n_x], both[n_x:], p)
    return differentiate("path", both, ca.SX.sym("none", 0), p, values)


def _kernel(name: str, function: Callable[[str], ca.Function]) -> Kernel:
    return Kernel(function(name), function(f"{name}_jacobian"), function(f"{name}_hessian"))


def _assemble(function: Callable[[str], ca.Function], *, with_path: bool, compiled: bool) -> Kernels:
    return Kernels(_kernel("step", function), _kernel("path", function) if with_path else None, compiled)


def _load(library: Path, *, with_path: bool) -> Kernels:
    try:
        return _assemble(lambda name: ca.external(name, str(library)), with_path=with_path, compiled=True)
    except RuntimeError as error:  # casadi raises it for a library that cannot be opened
        raise KernelError(f"{library}: {error}") from error


def _library(system: System, scheme: RungeKutta) -> Path:
    return kernel_library.cache_folder() / f"{_fingerprint(system, scheme)}.so"


def _fingerprint(system: System, scheme: RungeKutta) -> str:
    """Hash of everything the machine code depends on."""
    digest = hashlib.sha256()
    functions = [system.rates, system.path_values, system.projection]
    parts = [function.serialize() if function is not None else "none" for function in functions]
    flags = (*kernel_library.COMPILE_FLAGS, *kernel_library.HIDDEN_FLAGS, *DRIVER_FLAGS)
    parts += [repr(scheme), ca.CasadiMeta.version(), platform.machine(), *flags, driver_text(), str(FORMAT)]
    for part in parts:
        digest.update(part.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]
