"""The libraries of compiled kernels: where they are kept, whether they are intact, how they are made."""

import hashlib
import logging
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

from airrace.errors import KernelError
from airrace.optimal_control.one_at_a_time import alone
from airrace.optimal_control.private_folder import is_private, make_private
from airrace.records import record

logger = logging.getLogger(__name__)

COMPILE_FLAGS = ("-fPIC", "-ffp-contract=off")
"""The compiler flags for all sources.

No product is fused with a sum, so that single numbers and vectors have the same bits.
"""

LINK_FLAGS = ("-shared",)
GENERATED_FLAGS = ("-O1",)
"""The compiler flags for code that casadi generates.

It is straight-line scalar arithmetic, which -O2 makes no faster in twice the compile time.
"""

HIDDEN_FLAGS = (*GENERATED_FLAGS, '-DCASADI_SYMBOL_EXPORT=__attribute__((visibility("hidden")))')


@record
class Source:
    """The content of a C file that is to be compiled.

    Attributes:
        name: of the file, without suffix.
        text: its contents.
        flags: for the compiler, besides `COMPILE_FLAGS`.
    """

    name: str
    text: str
    flags: tuple[str, ...]


def generated_source(function: ca.Function, *, hidden: bool = False) -> Source:
    """Return a casadi function in C; `hidden` if only other functions of the same library call it."""
    generator = ca.CodeGenerator(f"{function.name()}.c", {"with_header": False})
    generator.add(function)
    return Source(function.name(), generator.dump(), HIDDEN_FLAGS if hidden else GENERATED_FLAGS)


def cache_folder() -> Path:
    """Return the folder of compiled kernels: `AIRRACE_CACHE_DIR`, else one in the user's cache folder.

    A user without a home has one among the temporary folders.
    """
    if explicit := os.environ.get("AIRRACE_CACHE_DIR"):
        return Path(explicit)
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "airrace" / "kernels"
    except RuntimeError:  # neither HOME nor an entry in the list of users
        return Path(tempfile.gettempdir()) / f"airrace-kernels-{os.geteuid()}"


def is_intact(library: Path) -> bool:
    """Return whether a library is what was compiled, and by this user.

    Loading a truncated one would kill the process, and loading that of a stranger would run the stranger's code.
    """
    try:
        return is_private(library) and _checksum_file(library).read_bytes() == _checksum(library)
    except OSError:
        return False


def find_compiler() -> str:
    """Return the C compiler: `CC` if set (empty: none), else the first found on the path.

    Raises:
        KernelError: there is none.
    """
    if "CC" in os.environ:
        chosen = os.environ["CC"]
        if not chosen or shutil.which(chosen) is None:
            raise KernelError(f"the C compiler CC={chosen!r} is not on the path")
        return chosen
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name) is not None:
            return name
    raise KernelError("no C compiler (cc, gcc, clang) on the path")


def compile_library(sources: Sequence[Source], target: Path) -> None:
    """Compile all sources side by side, and put the library in place in one step, then its checksum.

    Processes that want the same library do not compile it beside each other: the others wait and find it there.

    Raises:
        KernelError: there is no compiler, it fails, or the folder cannot be written to.
    """
    compiler = find_compiler()
    try:
        make_private(target.parent)
        with alone(target.with_suffix(".lock")):
            if not is_intact(target):
                logger.info("compiling %s with %s (once per machine)", sources[0].name, compiler)
                _compile(compiler, sources, target)
    except OSError as error:
        raise KernelError(f"the kernel cache {target.parent} cannot be used: {error}") from error


def _compile(compiler: str, sources: Sequence[Source], target: Path) -> None:
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        commands = [_compilation(compiler, source, Path(folder)) for source in sources]
        _run(commands)
        library, checksum = Path(folder) / "kernels.so", Path(folder) / "kernels.sha256"
        objects = [command[-1] for command in commands]
        _run([[compiler, *LINK_FLAGS, "-o", str(library), *objects, "-lm"]])
        checksum.write_bytes(_checksum(library))
        for made in (library, checksum):
            made.chmod(0o600)  # whatever the umask leaves to others
        os.replace(library, target)
        os.replace(checksum, _checksum_file(target))


def _checksum(library: Path) -> bytes:
    return hashlib.sha256(library.read_bytes()).hexdigest().encode()


def _checksum_file(library: Path) -> Path:
    return library.with_suffix(".sha256")


def _compilation(compiler: str, source: Source, folder: Path) -> list[str]:
    """Write a C source, and return the command that compiles it, the object file last."""
    path = folder / f"{source.name}.c"
    path.write_text(source.text, encoding="utf-8")
    return [compiler, *COMPILE_FLAGS, *source.flags, "-c", str(path), "-o", str(path.with_suffix(".o"))]


def _run(commands: Sequence[Sequence[str]]) -> None:
    """Run commands side by side; none continues after this function is left."""
    running: list[subprocess.Popen[bytes]] = []
    try:
        for command in commands:
            running.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT))
        for command, process in zip(commands, running, strict=True):
            text, _ = process.communicate()
            if process.returncode:
                message = text.decode(errors="replace").strip()[:500]
                raise KernelError(f"{command[0]} failed: {message}")
    finally:
        for process in running:
            if process.poll() is None:
                process.terminate()
                process.communicate()
            assert process.stdout is not None
            process.stdout.close()
