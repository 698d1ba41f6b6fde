"""The C files of this package that belong to no model: compiled once per machine, and kept beside the kernels."""

import hashlib
import platform
from pathlib import Path

import casadi as ca

from airrace.optimal_control import kernel_library
from airrace.optimal_control.kernel_library import Source


def compiled(file: Path, flags: tuple[str, ...]) -> Path:
    """Return the compiled library of a file, built unless the cache has it intact.

    Args:
        file: a C file.
        flags: for the compiler, besides those of all sources.

    Raises:
        KernelError: it cannot be built.
    """
    return compiled_text(file.stem, file.read_text(encoding="utf-8"), flags)


def compiled_text(name: str, text: str, flags: tuple[str, ...]) -> Path:
    """Return the compiled library of a source, built unless the cache has it intact.

    Args:
        name: of the file that a compiler sees.
        text: the source.
        flags: for the compiler, besides those of all sources.

    Raises:
        KernelError: it cannot be built.
    """
    library = library_of(text, flags)
    if not kernel_library.is_intact(library):
        kernel_library.compile_library([Source(name, text, flags)], library)
    return library


def library_of(text: str, flags: tuple[str, ...]) -> Path:
    """Return where the compiled library of a source is, or will be."""
    parts = (text, *kernel_library.COMPILE_FLAGS, *flags, platform.machine(), ca.CasadiMeta.version())
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]
    return kernel_library.cache_folder() / f"{digest}.so"
