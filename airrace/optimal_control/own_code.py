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
    text = file.read_text(encoding="utf-8")
    parts = (text, *kernel_library.COMPILE_FLAGS, *flags, platform.machine(), ca.CasadiMeta.version())
    name = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]
    library = kernel_library.cache_folder() / f"{name}.so"
    if not kernel_library.is_intact(library):
        kernel_library.compile_library([Source(file.stem, text, flags)], library)
    return library
