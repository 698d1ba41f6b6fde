"""How many intervals this machine's processor evaluates at once, one per lane of its vector registers."""

import platform
from dataclasses import dataclass
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class InstructionSet:
    """Vector instructions.

    Attributes:
        lanes: numbers of double precision in a vector.
        flags: that let a compiler use them.
    """

    lanes: int
    flags: tuple[str, ...]


SINGLE = InstructionSet(1, ())
"""No vectors: one interval at a time."""

_PREFIXES = 8192
"""Bytes of the processor's description that are read: those of the first core, the others are alike."""


@cache
def instruction_set() -> InstructionSet:
    """The widest that the processor knows; kernels for it run on no lesser one."""
    if platform.machine() in ("x86_64", "AMD64"):
        known = _processor_flags()
        if {"avx512f", "avx512dq", "avx512vl"} <= known:
            return InstructionSet(8, ("-mavx512f", "-mavx512dq", "-mavx512vl"))
        if "avx2" in known:
            return InstructionSet(4, ("-mavx2",))
        return InstructionSet(2, ())  # SSE2 belongs to the architecture
    if platform.machine() in ("aarch64", "arm64"):
        return InstructionSet(2, ())
    return SINGLE


def _processor_flags() -> set[str]:
    """Names of the instruction sets as Linux tells them; empty where it does not run."""
    try:
        with Path("/proc/cpuinfo").open("rb") as description:
            text = description.read(_PREFIXES).decode(errors="replace")
    except OSError:
        return set()
    lines = [line for line in text.splitlines() if line.startswith("flags")]
    return set(lines[0].partition(":")[2].split()) if lines else set()
