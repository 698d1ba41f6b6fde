"""How much work something is, counted: no clock is read, so it does not matter what else the machine does."""

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

STEP = 4
"""How many times as large the larger one of two inputs is."""
SQUARE = 0.004
"""The share of the work on the smaller one that may grow with the square of the input."""


def operations(work: Callable[[], object]) -> int:
    """Lines of Python, those of loops each time round, and calls of functions in C, whatever these do within."""
    counted = 0

    def line(_: FrameType, event: str, __: Any) -> Any:
        nonlocal counted
        counted += event == "line"
        return line

    def call(_: FrameType, event: str, __: Any) -> None:
        nonlocal counted
        counted += event == "c_call"

    before = sys.gettrace(), sys.getprofile()
    sys.settrace(line)
    sys.setprofile(call)
    try:
        work()
    finally:
        sys.setprofile(before[1])
        sys.settrace(before[0])
    return counted


def assert_grows_no_faster_than_its_input(work: Callable[[int], object], size: int) -> None:
    """Four times the input is at most about four times the work, not 16 times."""
    work(size)  # what is loaded only once, is loaded
    few, many = (operations(lambda count=count: work(count)) for count in (size, STEP * size))
    assert 0 < many < (STEP + SQUARE * STEP * (STEP - 1)) * few
