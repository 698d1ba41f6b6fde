"""Kernels of two makings compared at the same points."""

import shutil

import casadi as ca
import numpy as np
import pytest

from airrace.optimal_control.kernels import Kernel

needs_compiler = pytest.mark.skipif(
    not any(shutil.which(name) for name in ("cc", "gcc", "clang")), reason="there is no C compiler"
)


def random_arguments(kernel: Kernel, seed: int) -> list[np.ndarray]:
    """y, own, shared and multipliers."""
    random = np.random.default_rng(seed)
    return [random.normal(size=kernel.hessian.size1_in(index)) for index in range(4)]


def outputs(kernel: Kernel, point: list[np.ndarray]) -> list[np.ndarray]:
    """All outputs of a kernel's functions at (y, own, shared, lam)."""
    results = [kernel.value(*point[:3]), *kernel.jacobian(*point[:3]), *kernel.hessian(*point)]
    return [np.asarray(one.full()) for one in results]


def assert_equal(kernel: Kernel, expected: Kernel, point: list[np.ndarray]) -> None:
    """Every output differs by no more than 1e-12 of its largest entry."""
    for mine, theirs in zip(outputs(kernel, point), outputs(expected, point), strict=True):
        assert np.isfinite(theirs).all()
        assert np.abs(mine - theirs).max(initial=0.0) <= 1e-12 * np.abs(theirs).max(initial=0.0)


def assert_equal_patterns(kernel: Kernel, expected: Kernel) -> None:
    """Both hold the same entries."""
    for mine, theirs in ((kernel.jacobian, expected.jacobian), (kernel.hessian, expected.hessian)):
        for place in range(2):
            assert entries(mine.sparsity_out(place)) == entries(theirs.sparsity_out(place))


def entries(sparsity: ca.Sparsity) -> set[tuple[int, int]]:
    """Rows and columns of the nonzeros."""
    return set(zip(*sparsity.get_triplet(), strict=True))
