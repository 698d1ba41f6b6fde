"""The functions of one shooting interval and their derivatives: generated once per system, compiled, cached.

Every kernel maps `(y, own, shared)` to values c, with y the unknowns, `own` what differs from call to call and `shared`
what does not:

    step: y = (x, u, T), own = the interval's share of the duration T, shared = p    -> x at the interval's end
    path: y = (x, u), own empty, shared = p                                          -> path quantities

A compiled library is kept per machine, named by a hash of all it depends on. Without a C compiler casadi's own virtual
machine evaluates the same functions, slower.
"""

import hashlib
import logging
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca

from airrace.errors import KernelError
from airrace.optimal_control.integrators import RungeKutta
from airrace.system import Observation, System

logger = logging.getLogger(__name__)

LINK_FLAGS = ("-shared",)
COMPILE_FLAGS = ("-O1", "-fPIC")  # -O2 -march=native gains a fifth in speed and doubles the compile time
FORMAT = 2


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
            return _load(_library(system, scheme), with_path=with_path)
        except KernelError as error:
            logger.warning("no compiled kernels, evaluating in casadi's virtual machine: %s", error)
    return _assemble(symbolic_kernels(system, scheme).__getitem__, with_path=with_path, compiled=False)


def symbolic_kernels(system: System, scheme: RungeKutta) -> dict[str, ca.Function]:
    """All kernel functions as SX graphs, by name."""
    n_x, n_u = len(system.states), len(system.controls)
    y = ca.SX.sym("y", n_x + n_u + 1)
    p = ca.SX.sym("p", len(system.parameters))
    fraction, nothing = ca.SX.sym("fraction"), ca.SX.sym("none", 0)
    x, u, duration = y[:n_x], y[n_x : n_x + n_u], y[n_x + n_u]
    x_next = scheme.advance(system.rates, x, u, p, duration * fraction)
    if system.projection is not None:
        x_next = system.projection(x_next)
    functions = differentiate("step", y, fraction, p, x_next)
    if system.path_values is not None:
        both = y[: n_x + n_u]
        functions |= differentiate("path", both, nothing, p, system.path_values(x, u, p))
    return functions


def _kernel(name: str, function: Callable[[str], ca.Function]) -> Kernel:
    return Kernel(function(name), function(f"{name}_jacobian"), function(f"{name}_hessian"))


def _assemble(function: Callable[[str], ca.Function], *, with_path: bool, compiled: bool) -> Kernels:
    return Kernels(_kernel("step", function), _kernel("path", function) if with_path else None, compiled)


def _load(library: Path, *, with_path: bool) -> Kernels:
    try:
        return _assemble(lambda name: ca.external(name, str(library)), with_path=with_path, compiled=True)
    except RuntimeError as error:  # casadi raises it for a library that cannot be opened
        raise KernelError(f"{library}: {error}") from error


def cache_folder() -> Path:
    """Where compiled kernels are kept: `AIRRACE_CACHE_DIR`, else the user's cache folder."""
    if explicit := os.environ.get("AIRRACE_CACHE_DIR"):
        return Path(explicit)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "airrace" / "kernels"


def needs_compiling(system: System, scheme: RungeKutta) -> bool:
    """Whether the kernels have yet to be compiled, by a compiler that is there."""
    try:
        _compiler()
    except KernelError:
        return False
    return not _intact(_cached(system, scheme))


def _cached(system: System, scheme: RungeKutta) -> Path:
    return cache_folder() / f"{_fingerprint(system, scheme)}.so"


def _library(system: System, scheme: RungeKutta) -> Path:
    """The compiled library of a system, built unless the cache has it whole."""
    path = _cached(system, scheme)
    if not _intact(path):
        _compile(symbolic_kernels(system, scheme).values(), path)
    return path


def _intact(library: Path) -> bool:
    """Whether a library is what was compiled: loading a truncated one would kill the process."""
    try:
        return _checksum_file(library).read_bytes() == _checksum(library)
    except OSError:
        return False


def _checksum(library: Path) -> bytes:
    return hashlib.sha256(library.read_bytes()).hexdigest().encode()


def _checksum_file(library: Path) -> Path:
    return library.with_suffix(".sha256")


def _fingerprint(system: System, scheme: RungeKutta) -> str:
    """Hash of everything the machine code depends on."""
    digest = hashlib.sha256()
    functions = [system.rates, system.path_values, system.projection]
    parts = [function.serialize() if function is not None else "none" for function in functions]
    parts += [repr(scheme), ca.CasadiMeta.version(), platform.machine(), *COMPILE_FLAGS, str(FORMAT)]
    for part in parts:
        digest.update(part.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]


def _compiler() -> str:
    """The C compiler: `CC` if set (empty: none), else the first found on the path."""
    if "CC" in os.environ:
        chosen = os.environ["CC"]
        if not chosen or shutil.which(chosen) is None:
            raise KernelError(f"the C compiler CC={chosen!r} is not on the path")
        return chosen
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name) is not None:
            return name
    raise KernelError("no C compiler (cc, gcc, clang) on the path")


def _compile(functions: Iterable[ca.Function], target: Path) -> None:
    """Generate, compile and place the library under its final name in one step, then its checksum.

    Every function is a file of its own and all are compiled side by side; the Hessian's takes as long as all others.
    """
    compiler = _compiler()
    logger.info("compiling kernels with %s (once per model and machine)", compiler)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as folder:
            commands = [_compilation(compiler, function, Path(folder)) for function in functions]
            running = [subprocess.Popen(one, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) for one in commands]
            outputs = [(process.communicate()[0], process.returncode) for process in running]
            library, checksum = Path(folder) / "kernels.so", Path(folder) / "kernels.sha256"
            objects = [command[-1] for command in commands]
            link = [compiler, *LINK_FLAGS, "-o", str(library), *objects, "-lm"]
            if all(status == 0 for _, status in outputs):
                linked = subprocess.run(link, capture_output=True, check=False)
                outputs.append((linked.stderr, linked.returncode))
            for text, status in outputs:
                if status:
                    raise KernelError(f"{compiler} failed: {text.decode(errors='replace').strip()[:500]}")
            checksum.write_bytes(_checksum(library))
            os.replace(library, target)
            os.replace(checksum, _checksum_file(target))
    except OSError as error:
        raise KernelError(f"the kernel cache {target.parent} cannot be used: {error}") from error


def _compilation(compiler: str, function: ca.Function, folder: Path) -> list[str]:
    """Write the C source of one function; the command that compiles it, the object file last."""
    generator = ca.CodeGenerator(f"{function.name()}.c", {"with_header": False})
    generator.add(function)
    generator.generate(str(folder) + os.sep)
    source = folder / f"{function.name()}.c"
    return [compiler, *COMPILE_FLAGS, "-c", str(source), "-o", str(source.with_suffix(".o"))]
