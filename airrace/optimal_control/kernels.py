"""The functions of one shooting interval and their derivatives: generated once per system, compiled, cached.

Every kernel maps `(y, own, shared)` to values c, with y the unknowns, `own` what differs from call to call and `shared`
what does not:

    step: y = (x, u, T), own = the interval's share of the duration T, shared = p    -> x at the interval's end
    path: y = (x, u), own empty, shared = p                                          -> path quantities

Compiled, the step and its derivatives are composed from those of its stages, see `step_kernel.py`; all else is the
graph that casadi makes. The functions take several intervals at once where processor and compiler have vectors, see
`lanes.h`; an interval's results are the same bits then. A library is kept per machine, named by a hash of all it
depends on. Without a C compiler casadi's own virtual machine evaluates the graphs, the step's among them, slower.
"""

import hashlib
import logging
import platform
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import casadi as ca

from airrace.errors import KernelError
from airrace.optimal_control import background_compilation, kernel_library, mapping
from airrace.optimal_control.c_tables import read_text
from airrace.optimal_control.kernel_library import Source, generated_source
from airrace.optimal_control.lane_code import VECTOR_FLAGS, has_lanes, header, lane_functions
from airrace.optimal_control.lane_interface import Shape, interface_source, interface_text, shape_of
from airrace.optimal_control.lanes import SINGLE, InstructionSet, instruction_set
from airrace.optimal_control.mapping import Bound, Callee, Part
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.step_kernel import StepSources, driver_text, step_sources
from airrace.records import record
from airrace.system import Observation, System
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

DRIVER_FLAGS = ("-O3",)
"""The compiler flags for the driver's loops over sensitivities, which run a third faster than with -O2.

For lanes they are written out, and -O2 does.
"""

LANE_FLAGS = ("-O2",)
"""The compiler flags for the driver on lanes, and for the code that carries numbers to the lanes and back.

With -O3 a Hessian of six-dof takes 4 % less time and one of the point mass as much, in twice the compile time.
"""

TOGETHER = 1000
"""The number of operations up to which generated functions share a file: for some a compiler takes longest to start."""

FORMAT = 7
"""The number of the form of the generated code.

It is raised with every change of the form, so that no cached library of another form is used.
"""


@record
class Kernel:
    """A function and its derivatives in y, shapes (n_y,), (n_own,), (n_shared,) -> (n_c,).

    Attributes:
        value: (y, own, shared) -> c.
        jacobian: (y, own, shared) -> c, dc/dy.
        hessian: (y, own, shared, lam) -> gradient (n_y,) and upper triangle of the Hessian of lam . c.
        several: the same for so many intervals at once as it has lanes: arguments and results stand side by side, but
            for `shared`, of which there is one. None if the kernel is evaluated one interval at a time.
        lanes: number of intervals in a call.
    """

    value: ca.Function
    jacobian: ca.Function
    hessian: ca.Function
    several: "Kernel | None" = None
    lanes: int = 1

    @property
    def values(self) -> int:
        """The number of values."""
        return self.value.size1_out(0)

    @property
    def jacobian_pattern(self) -> ca.Sparsity:
        """The pattern of the Jacobian."""
        return self.jacobian.sparsity_out(1)

    @property
    def hessian_pattern(self) -> ca.Sparsity:
        """The pattern of the Hessian's upper triangle."""
        return self.hessian.sparsity_out(1)

    def mapped(self, part: Part, calls: int, threads: int) -> ca.Function:
        """Return all calls of a function at once, see `mapping.Callee`."""
        return mapping.mapped(self._function(part), calls, mapping.spread(calls, self.lanes, threads))

    def bound(self, part: Part, calls: int, threads: int, given: Sequence[Array]) -> Bound:
        """Return all calls of a function at once, on arrays that stay, see `mapping.Callee`."""
        return mapping.bound_to_all(self._function(part), calls, mapping.spread(calls, self.lanes, threads), given)

    def _function(self, part: Part) -> ca.Function:
        of = self.several or self
        return (of.value, of.jacobian, of.hessian)[part]


@record
class Kernels:
    """The kernels of a system; `path` is None for a system without path quantities."""

    step: Callee
    path: Callee | None
    compiled: bool


def differentiate(name: str, y: ca.SX, own: ca.SX, shared: ca.SX, c: ca.SX) -> dict[str, ca.Function]:
    """Return the functions of a kernel by their names `name`, `name_jacobian`, `name_hessian`."""
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
    """Return the kernel of a boundary's observation: y = x, own = the boundary's values, nothing shared."""
    x, values, nothing = ca.SX.sym("x", states), ca.SX.sym("b", len(observation.parameters)), ca.SX.sym("none", 0)
    functions = differentiate("observe", x, values, nothing, observation.values(x, values))
    return _kernel("observe", functions.__getitem__)


def build_kernels(
    system: System, scheme: RungeKutta, *, compiled: bool, instructions: InstructionSet | None = None
) -> Kernels:
    """Return the kernels of a system; compiled if wanted and possible, from the cache where it has them.

    Args:
        instructions: for which they are compiled; None for the widest that this machine has.
    """
    with_path = system.path_values is not None
    if compiled:
        try:
            return _compiled(system, scheme, instructions or _instructions(system))
        except KernelError as error:
            logger.warning("no compiled kernels, evaluating in casadi's virtual machine: %s", error)
    return _assemble(symbolic_kernels(system, scheme).__getitem__, with_path=with_path, compiled=False)


def _compiled(system: System, scheme: RungeKutta, instructions: InstructionSet) -> Kernels:
    """Return the kernels compiled; for one interval at a time where the compiler knows no vectors.

    Raises:
        KernelError: they cannot be compiled.
    """
    with_path = system.path_values is not None
    try:
        library = compile_kernels(system, scheme, instructions)
    except KernelError as error:
        if instructions.lanes == 1:
            raise
        logger.info("no kernels for several intervals at once: %s", error)
        return _compiled(system, scheme, SINGLE)
    return _load(library, with_path=with_path, lanes=instructions.lanes)


def compile_kernels(
    system: System,
    scheme: RungeKutta,
    instructions: InstructionSet | None = None,
    *,
    at_once: int = kernel_library.SIDE_BY_SIDE,
) -> Path:
    """Return the compiled library of a system, built unless the cache has it intact.

    Args:
        system, scheme: that it is of.
        instructions: for which it is compiled; None for the widest that this machine has.
        at_once: number of compilers that run at a time.

    Raises:
        KernelError: it cannot be built.
    """
    chosen = _instructions(system) if instructions is None else instructions
    library = _library(system, scheme, chosen)
    if not kernel_library.is_intact(library):
        sources = _sources(system, scheme) if chosen.lanes == 1 else _lane_sources(system, scheme, chosen)
        kernel_library.compile_library(sources, library, at_once=at_once)
    return library


def cached_rows(system: System, scheme: RungeKutta) -> Path | None:
    """Return the cached library that evaluates rates and path quantities at many points; None if there is none."""
    instructions = _instructions(system)
    library = _library(system, scheme, instructions)
    return library if instructions.lanes > 1 and kernel_library.is_intact(library) else None


def needs_compiling(system: System, scheme: RungeKutta) -> bool:
    """Return whether the kernels have yet to be compiled, by a compiler that exists."""
    try:
        kernel_library.find_compiler()
    except KernelError:
        return False
    return not kernel_library.is_intact(_library(system, scheme, _instructions(system)))


def prepare(system: System, scheme: RungeKutta) -> None:
    """Let the kernels be compiled in the background if they need it."""
    if needs_compiling(system, scheme):
        background_compilation.order(_library(system, scheme, _instructions(system)), system, scheme)


def symbolic_kernels(system: System, scheme: RungeKutta) -> dict[str, ca.Function]:
    """Return all kernel functions as SX graphs, by name."""
    y, fraction, p = _arguments(system)
    return differentiate("step", y, fraction, p, _end(system, scheme, y, fraction, p)) | path_functions(system)


def _sources(system: System, scheme: RungeKutta) -> list[Source]:
    """Return the sources of `symbolic_kernels`, those of the step composed."""
    composed = step_sources(system, scheme)
    return [
        *(generated_source(function, hidden=True) for function in (composed.rates, *composed.generated)),
        Source("step_kernel", read_text("one_lane.h") + composed.driver, DRIVER_FLAGS),
        *(generated_source(function) for function in path_functions(system).values()),
    ]


def _lane_sources(system: System, scheme: RungeKutta, instructions: InstructionSet) -> list[Source]:
    """Return the sources for several intervals at once; rates and path quantities serve the replay, too."""
    lanes, path = instructions.lanes, path_functions(system)
    composed = step_sources(system, scheme, lanes=lanes)
    before, flags = header(lanes), (*VECTOR_FLAGS, *instructions.flags)
    shapes = _step_shapes(system, composed) | {name: shape_of(function) for name, function in path.items()}
    rows = {"rates": len(system.states)} | ({"path": len(system.path)} if path else {})
    functions = {function.name(): function for function in composed.generated}
    functions |= {f"{function.name()}_of_lanes": function for function in (composed.rates, *path.values())}
    return [  # the slowest first
        Source("step_kernel", before + composed.driver, (*LANE_FLAGS, *flags)),
        *(
            Source("_and_".join(part), before + lane_functions(part), (*kernel_library.GENERATED_FLAGS, *flags))
            for part in _together(functions)
        ),
        Source("interface", interface_source(shapes, rows, system, lanes), (*LANE_FLAGS, *flags)),
    ]


def _together(functions: Mapping[str, ca.Function]) -> list[dict[str, ca.Function]]:
    """Return functions in parts of at most `TOGETHER` operations, or of one function each."""
    parts: list[dict[str, ca.Function]] = []
    room = 0
    for name, function in functions.items():
        if (room := room - function.n_instructions()) < 0:
            parts.append({})
            room = TOGETHER - function.n_instructions()
        parts[-1][name] = function
    return parts


def _step_shapes(system: System, composed: StepSources) -> dict[str, Shape]:
    y, fraction, p = (symbols.sparsity() for symbols in _arguments(system))
    x = ca.Sparsity.dense(len(system.states))
    return {
        "step": Shape([y, fraction, p], [x]),
        "step_jacobian": Shape([y, fraction, p], [x, composed.jacobian]),
        "step_hessian": Shape([y, fraction, p, x], [y, composed.hessian]),
    }


def _instructions(system: System) -> InstructionSet:
    """Return the machine's instruction set, or single numbers for a system with operations unknown to lanes."""
    functions = (system.rates, system.path_values, system.projection)
    known = all(function is None or has_lanes(function) for function in functions)
    return instruction_set() if known else SINGLE


def _arguments(system: System) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return symbols of y = (x, u, T), of the interval's share of T, and of p."""
    y = ca.SX.sym("y", len(system.states) + len(system.controls) + 1)
    return y, ca.SX.sym("fraction"), ca.SX.sym("p", len(system.parameters))


def _end(system: System, scheme: RungeKutta, y: ca.SX, fraction: ca.SX, p: ca.SX) -> ca.SX:
    """Return the state at the interval's end."""
    n_x = len(system.states)
    x_next: ca.SX = scheme.advance(system.rates, y[:n_x], y[n_x:-1], p, y[-1] * fraction)
    return x_next if system.projection is None else system.projection(x_next)


def path_functions(system: System) -> dict[str, ca.Function]:
    """Return the functions of a system's path quantities by name, none for a system without."""
    if system.path_values is None:
        return {}
    y, _, p = _arguments(system)
    n_x, both = len(system.states), y[:-1]
    values = system.path_values(both[:n_x], both[n_x:], p)
    return differentiate("path", both, ca.SX.sym("none", 0), p, values)


def _kernel(name: str, function: Callable[[str], ca.Function]) -> Kernel:
    return Kernel(function(name), function(f"{name}_jacobian"), function(f"{name}_hessian"))


def _assemble(function: Callable[[str], ca.Function], *, with_path: bool, compiled: bool, lanes: int = 1) -> Kernels:
    def kernel(name: str) -> Kernel:
        loaded = _kernel(name, function)
        return loaded if lanes == 1 else _of_one(loaded, lanes)

    return Kernels(kernel("step"), kernel("path") if with_path else None, compiled)


def _of_one(several: Kernel, lanes: int) -> Kernel:
    """Return the kernel of one interval, which stands in every lane."""
    value, jacobian, hessian = (
        _first_of_lanes(function, lanes) for function in (several.value, several.jacobian, several.hessian)
    )
    return Kernel(value, jacobian, hessian, several, lanes)


def _first_of_lanes(function: ca.Function, lanes: int) -> ca.Function:
    given = [
        ca.MX.sym(f"i{place}", function.size1_in(place), function.size2_in(place) // (1 if place == 2 else lanes))
        for place in range(function.n_in())
    ]
    repeated = [one if place == 2 else ca.repmat(one, 1, lanes) for place, one in enumerate(given)]
    found = function(*repeated)
    outputs = found if isinstance(found, tuple) else (found,)
    return ca.Function(function.name(), given, [one[:, : one.size2() // lanes] for one in outputs])


def _load(library: Path, *, with_path: bool, lanes: int) -> Kernels:
    try:
        return _assemble(lambda name: ca.external(name, str(library)), with_path=with_path, compiled=True, lanes=lanes)
    except RuntimeError as error:  # casadi raises it for a library that cannot be opened
        raise KernelError(f"{library}: {error}") from error


def _library(system: System, scheme: RungeKutta, instructions: InstructionSet) -> Path:
    return kernel_library.cache_folder() / f"{_fingerprint(system, scheme, instructions)}.so"


@lru_cache(maxsize=32)
def _fingerprint(system: System, scheme: RungeKutta, instructions: InstructionSet) -> str:
    """Return a hash of everything that the machine code depends on."""
    digest = hashlib.sha256()
    functions = [system.rates, system.path_values, system.projection]
    parts = [function.serialize() if function is not None else "none" for function in functions]
    flags = (*kernel_library.COMPILE_FLAGS, *kernel_library.HIDDEN_FLAGS, *DRIVER_FLAGS)
    if instructions.lanes > 1:
        parts += [repr(instructions), *VECTOR_FLAGS, *LANE_FLAGS, header(instructions.lanes), interface_text()]
    parts += [
        repr(scheme),
        ca.CasadiMeta.version(),
        platform.machine(),
        *flags,
        read_text("one_lane.h"),
        driver_text(),
        str(FORMAT),
    ]
    for part in parts:
        digest.update(part.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]
