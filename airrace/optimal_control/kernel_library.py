"""The libraries of compiled kernels: where they are kept, whether they are intact, how they are made."""

import contextlib
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
from airrace.optimal_control.private_folder import PRIVATE, is_private, make_private
from airrace.records import record

logger = logging.getLogger(__name__)

COMPILE_FLAGS = ("-fPIC", "-ffp-contract=off")
"""The compiler flags for all sources.

No product is fused with a sum, so that single numbers and vectors have the same bits.
"""

SIDE_BY_SIDE = 16
"""The number of compilers that run at a time where somebody waits for the library."""

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


def compile_library(sources: Sequence[Source], target: Path, *, at_once: int = SIDE_BY_SIDE) -> None:
    """Compile all sources, and put the library in place in one step, then its checksum.

    Processes that want the same library do not compile it beside each other: the others wait and find it there. What is
    compiled of a library when its process ends is kept for the next one that begins with it.

    Args:
        sources: to be compiled.
        target: the library.
        at_once: number of compilers that run at a time.

    Raises:
        KernelError: there is no compiler, it fails, or the folder cannot be written to.
    """
    compiler = find_compiler()
    try:
        make_private(target.parent)
        with alone(target.with_suffix(".lock")):
            if not is_intact(target):
                logger.info("compiling %s with %s (once per machine)", sources[0].name, compiler)
                _compile(compiler, sources, target, at_once)
    except OSError as error:
        raise KernelError(f"the kernel cache {target.parent} cannot be used: {error}") from error


def _compile(compiler: str, sources: Sequence[Source], target: Path, at_once: int) -> None:
    parts = target.with_suffix(".parts")
    parts.mkdir(mode=PRIVATE, exist_ok=True)
    try:
        with tempfile.TemporaryDirectory(dir=parts) as temporary:
            folder = Path(temporary)
            works = [_compilation(compiler, source, folder, parts) for source in sources]
            _run([work for work in works if not is_private(work.result)], at_once)
            library, checksum = folder / "kernels.so", folder / "kernels.sha256"
            objects = [str(work.result) for work in works]
            _run([_Work([compiler, *LINK_FLAGS, "-o", str(library), *objects, "-lm"], library, library)], at_once)
            checksum.write_bytes(_checksum(library))
            for made in (library, checksum):
                made.chmod(0o600)  # whatever the umask leaves to others
            os.replace(library, target)
            os.replace(checksum, _checksum_file(target))
        shutil.rmtree(parts)
    except KernelError:
        shutil.rmtree(parts)
        raise
    finally:
        with contextlib.suppress(OSError):  # it is gone, or holds what is finished
            parts.rmdir()


def _checksum(library: Path) -> bytes:
    return hashlib.sha256(library.read_bytes()).hexdigest().encode()


def _checksum_file(library: Path) -> Path:
    return library.with_suffix(".sha256")


@record
class _Work:
    """A command, the file that it makes, and the place of that file once it is finished."""

    command: Sequence[str]
    made: Path
    result: Path


def _compilation(compiler: str, source: Source, folder: Path, parts: Path) -> _Work:
    """Write a C source to a folder, and return the command that compiles it."""
    path = folder / f"{source.name}.c"
    path.write_text(source.text, encoding="utf-8")
    told = "\0".join((source.text, *source.flags))
    made, name = path.with_suffix(".o"), hashlib.sha256(told.encode()).hexdigest()[:32]
    command = [compiler, *COMPILE_FLAGS, *source.flags, "-c", str(path), "-o", str(made)]
    return _Work(command, made, parts / f"{name}.o")


def _run(works: Sequence[_Work], at_once: int) -> None:
    """Run commands, so many at a time; none continues after this function is left."""
    running: list[tuple[_Work, subprocess.Popen[bytes]]] = []
    try:
        for work in works:
            if len(running) >= at_once:
                _finish(*running[0])
                del running[0]
            running.append((work, subprocess.Popen(work.command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)))
        for work, process in running:
            _finish(work, process)
    finally:
        for _, process in running:
            if process.poll() is None:
                process.terminate()
                process.communicate()
            assert process.stdout is not None
            process.stdout.close()


def _finish(work: _Work, process: "subprocess.Popen[bytes]") -> None:
    """Wait for a command, and put what it made in its place."""
    text, _ = process.communicate()
    if process.returncode:
        message = text.decode(errors="replace").strip()[:500]
        raise KernelError(f"{work.command[0]} failed: {message}")
    os.replace(work.made, work.result)
