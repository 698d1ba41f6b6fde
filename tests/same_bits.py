"""Kernels of two makings that give the same bits for all of their calls."""

from collections.abc import Sequence

import numpy as np

from airrace.optimal_control.mapping import Callee, Part


def results(kernel: Callee, part: Part, calls: int, given: Sequence[np.ndarray], threads: int = 1) -> list[np.ndarray]:
    """What a kernel returns for (y, own, shared, lam) of all intervals."""
    arguments = [np.ascontiguousarray(one).ravel() for one in given]
    call, found = kernel.bound(part, calls, threads, arguments if part is Part.HESSIAN else arguments[:3])
    call()
    return found


def assert_same_bits(mine: Callee, theirs: Callee, calls: int, given: Sequence[np.ndarray]) -> None:
    """All functions of two kernels are equal in every bit."""
    assert (mine.lanes, mine.values) == (theirs.lanes, theirs.values)
    assert mine.jacobian_pattern == theirs.jacobian_pattern
    assert mine.hessian_pattern == theirs.hessian_pattern
    for part in Part:
        pairs = zip(results(mine, part, calls, given), results(theirs, part, calls, given), strict=True)
        for one, other in pairs:
            known = np.isfinite(one)
            assert known.mean() > 0.5  # what makes an interval impossible to evaluate does so for both
            assert np.array_equal(one, other, equal_nan=True)
            assert np.array_equal(one[known].view(np.int64), other[known].view(np.int64))
