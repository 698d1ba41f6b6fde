"""The tables that the machine reads: those of a step or a function, behind each other in arrays."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.bytecode import NOTHING, Bytecode
from airrace.optimal_control.step_tables import Table
from airrace.records import record
from airrace.trajectory import Array


@record
class Tables:
    """The arrays that `tables.h` reads: tables, each behind its length, instructions, and numbers."""

    tables: NDArray[np.int32]
    code: NDArray[np.uint16]
    numbers: Array

    @classmethod
    def of(cls, tables: Sequence[Table], numbers: Sequence[float], functions: Sequence[Bytecode]) -> "Tables":
        """Return tables and numbers, followed by those of functions."""
        every = [*tables, *(table for function in functions for table in function.tables)]
        return cls(
            np.array([number for table in every for number in (len(table), *table)], dtype=np.int32),
            np.concatenate([function.code for function in (*functions, NOTHING)]),
            np.array(
                [*numbers, *(number for function in functions for number in function.constants)], dtype=np.float64
            ),
        )
