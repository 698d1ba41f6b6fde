"""The number of intervals that this machine's processor evaluates at once, one per lane of its vector registers."""

import platform
from functools import cache
from pathlib import Path

from airrace.records import record


@record
class InstructionSet:
    """A set of vector instructions.

    Attributes:
        lanes: numbers of double precision in a vector.
        flags: that let a compiler use them.
    """

    lanes: int
    flags: tuple[str, ...]


SINGLE = InstructionSet(1, ())
"""The instruction set without vectors: one interval at a time."""

_FIRST_CORE = 8192
"""The number of bytes that are read of the processor's description.

They hold the first core's, and the others are alike.
"""


_VECTORS = (
    InstructionSet(2, ()),  # SSE2 and Neon belong to their architectures
    InstructionSet(4, ("-mavx2",)),
    InstructionSet(8, ("-mavx512f", "-mavx512dq", "-mavx512vl")),
)


def instruction_set() -> InstructionSet:
    """Return the widest instruction set of the processor; kernels for it run on no lesser one."""
    return instruction_sets()[-1]


@cache
def instruction_sets() -> tuple[InstructionSet, ...]:
    """Return all instruction sets of the processor, from single numbers to the widest."""
    if platform.machine() in ("x86_64", "AMD64"):
        known = {f"-m{flag}" for flag in _processor_flags()}
        return (SINGLE, *(one for one in _VECTORS if known.issuperset(one.flags)))
    if platform.machine() in ("aarch64", "arm64"):
        return (SINGLE, _VECTORS[0])
    return (SINGLE,)


def _processor_flags() -> set[str]:
    """Return the names of the instruction sets as Linux tells them; empty on other systems."""
    try:
        with Path("/proc/cpuinfo").open("rb") as description:
            text = description.read(_FIRST_CORE).decode(errors="replace")
    except OSError:
        return set()
    lines = [line for line in text.splitlines() if line.startswith("flags")]
    return set(lines[0].partition(":")[2].split()) if lines else set()
