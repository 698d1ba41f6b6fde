"""The native library: loaded once, its variant chosen for the processor, its functions declared for ctypes.

`AIRRACE_NATIVE` names another variant that the processor executes (`baseline`, `avx2`, `avx512`), or `off`.
"""

import ctypes
import logging
import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from airrace.errors import KernelError

logger = logging.getLogger(__name__)

MISSING = (
    "airrace was installed without its native library, for want of a C compiler: casadi evaluates the models, some ten "
    "times slower"
)
"""The sentence for users where the library is missing."""

_POINTER = ctypes.c_void_p
_INT64 = ctypes.c_int64


class KernelTables(ctypes.Structure):
    """`struct kernel` of `evaluator.h`."""

    _fields_ = [(name, _POINTER) for name in ("tables", "code", "constants", "memory")]


class Batches(ctypes.Structure):
    """`struct batches` of `evaluator.h`."""

    _fields_ = [("arguments", _POINTER * 4), ("results", _POINTER * 4)]


class _Evaluator(ctypes.Structure):
    """`struct evaluator` of `evaluator.h`."""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("lanes", ctypes.c_int),
        ("function_memory", ctypes.CFUNCTYPE(_INT64, KernelTables)),
        ("step_memory", ctypes.CFUNCTYPE(_INT64, KernelTables, ctypes.c_int)),
        ("evaluate_function", ctypes.CFUNCTYPE(None, KernelTables, _POINTER, _INT64, _INT64)),
        ("evaluate_step", ctypes.CFUNCTYPE(None, KernelTables, ctypes.c_int, _POINTER, _INT64, _INT64)),
        ("evaluate_points", ctypes.CFUNCTYPE(None, KernelTables, *[_POINTER] * 4, _INT64)),
        ("interior_residuals", ctypes.CFUNCTYPE(None, *[_POINTER] * 6)),
        ("interior_multipliers", ctypes.CFUNCTYPE(None, *[_POINTER] * 3)),
        ("interior_factorise", ctypes.CFUNCTYPE(ctypes.c_int, *[_POINTER] * 2, ctypes.c_double)),
        ("interior_solve", ctypes.CFUNCTYPE(None, *[_POINTER] * 4)),
        (
            "interior_predictor_corrector",
            ctypes.CFUNCTYPE(None, *[_POINTER] * 4, ctypes.c_double, *[_POINTER] * 2),
        ),
    ]


@dataclass(frozen=True)
class Library:
    """The functions of the library.

    Attributes:
        variant: the name of the variant in use.
        lanes: number of intervals in a batch.
        operations: casadi's names of the operations that the interpreter knows, by their numbers.
        evaluator: the variant's functions, see `evaluator.h`.
        add_up, add_up_repeated: see `library.c`.
        translate: see `translator.c`.
    """

    variant: str
    lanes: int
    operations: tuple[str, ...]
    evaluator: Any  # ctypes makes its functions up
    add_up: Any
    add_up_repeated: Any
    translate: Any


@cache
def library() -> Library | None:
    """Return the library; None where it is missing or switched off, or has no such variant for this processor."""
    variant = os.environ.get("AIRRACE_NATIVE", "")
    if variant == "off":
        return None
    path = library_path()
    if path is None:
        return None
    try:
        return open_library(path, variant or None)
    except (OSError, KernelError) as error:
        logger.warning("casadi evaluates, slower, instead of the native library %s: %s", path, error)
        return None


def library_path() -> Path | None:
    """Return the library's file; None where there is none, for it was not built when the package was installed."""
    name = "airrace_native.dll" if os.name == "nt" else "airrace_native.so"
    path = Path(__file__).with_name(name)
    return path if path.is_file() else None


def open_library(path: Path, variant: str | None = None) -> Library:
    """Return the library of a file.

    Args:
        path: the file.
        variant: its name; None for the widest that the processor executes.

    Raises:
        KernelError: the processor does not execute the variant.
        OSError: the file cannot be loaded.
    """
    loaded = ctypes.CDLL(str(path))
    choose, names = loaded.airrace_evaluator, loaded.airrace_operations
    choose.argtypes, choose.restype = (ctypes.c_char_p,), ctypes.POINTER(_Evaluator)
    names.argtypes, names.restype = (), ctypes.c_char_p
    chosen = choose(variant.encode() if variant else None)
    if not chosen:
        raise KernelError(f"this processor executes no variant {variant}")
    for function, numbers, pointers in ((loaded.airrace_add_up, 1, 6), (loaded.airrace_add_up_repeated, 3, 12)):
        function.argtypes, function.restype = (*[_INT64] * numbers, *[_POINTER] * pointers), ctypes.c_int
    translate = loaded.airrace_translate
    translate.argtypes, translate.restype = (_INT64, _INT64, ctypes.c_int32, *[_POINTER] * 3), _INT64
    evaluator = chosen.contents
    return Library(
        variant=evaluator.name.decode(),
        lanes=evaluator.lanes,
        operations=tuple(names().decode().split()),
        evaluator=evaluator,
        add_up=loaded.airrace_add_up,
        add_up_repeated=loaded.airrace_add_up_repeated,
        translate=translate,
    )
