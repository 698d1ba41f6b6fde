"""Kernels of two makings, called for the same intervals."""

import contextlib
import sys
from collections.abc import Sequence

import numpy as np

from airrace.errors import KernelError
from airrace.optimal_control.kernels import Callee, Part
from airrace.optimal_control.native.library import Library, library_path, open_library


def results(kernel: Callee, part: Part, given: Sequence[np.ndarray], threads: int = 1) -> list[np.ndarray]:
    """What a kernel returns for y, own and lam of all intervals, a row each, and one `shared`: y, own, shared, lam.

    A row per interval; their number is a multiple of the kernel's lanes.
    """
    calls = len(given[0]) // kernel.lanes
    arguments = [np.ascontiguousarray(one, dtype=np.float64).ravel() for one in given]
    arguments[2] = np.tile(arguments[2], calls)
    call, found = kernel.bind(part, calls, threads, arguments if part is Part.HESSIAN else arguments[:3])
    call()
    return [one.reshape(len(given[0]), -1) for one in found]


def all_results(kernel: Callee, given: Sequence[np.ndarray], threads: int = 1) -> list[np.ndarray]:
    """The same of values, Jacobian and Hessian."""
    return [one for part in Part for one in results(kernel, part, given, threads)]


def random_intervals(kernel: Callee, own: int, shared: int, count: int, seed: int = 3) -> list[np.ndarray]:
    """Arguments of so many intervals for `results`."""
    random = np.random.default_rng(seed)
    y = kernel.hessian_pattern.size1()
    return [
        random.normal(size=(count, y)),
        random.normal(size=(count, own)),
        random.normal(size=shared),
        random.normal(size=(count, kernel.values)),
    ]


def assert_bitwise_equal(mine: Sequence[np.ndarray], theirs: Sequence[np.ndarray]) -> None:
    """All results are equal in every bit; what cannot be evaluated cannot be by both, and is the lesser part."""
    for one, other in zip(mine, theirs, strict=True):
        known = np.isfinite(one)
        assert known.mean() > 0.5
        assert np.array_equal(one, other, equal_nan=True)
        assert np.array_equal(one[known].view(np.int64), other[known].view(np.int64))


def assert_as_casadi(mine: Sequence[np.ndarray], theirs: Sequence[np.ndarray]) -> None:
    """All results are those of casadi, in every bit where both call the same C library.

    casadi's wheel for Windows has functions of msvcrt, a library that is built against the newer C library others.
    """
    if sys.platform != "win32":
        assert_bitwise_equal(mine, theirs)
    for one, other in zip(mine, theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


def variants() -> dict[str, Library]:
    """The variants of the native library that this processor executes, by name."""
    path = library_path()
    assert path is not None  # the tests need a compiler
    found: dict[str, Library] = {}
    for name in ("baseline", "avx2", "avx512"):
        with contextlib.suppress(KernelError):
            found[name] = open_library(path, name)
    return found
