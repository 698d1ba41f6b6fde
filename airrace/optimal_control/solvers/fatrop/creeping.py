"""Creeping: fatrop's short steps at nearly feasible points, seen in the lines that it prints.

From some guesses on, fatrop's factorisation claims negative curvature in every iteration where a sparse one finds none.
What it then adds to the Hessian, 1 to 50, leaves steps of 1e-4, and hundreds of iterations lead nowhere. Another
method, given the iterate and its multipliers, is soon done.
"""

import math
import re
from collections import deque

from airrace.records import record

# Columns: iteration (with r within a restoration), objective, inf_pr, inf_du, lg(mu), ||d||, lg(rg).
_ITERATION = re.compile(r"^\s*\d+(r?)\s+(\S+)\s+(\S+)\s+\S+\s+(\S+)\s+\S+\s+(\S+)\s")


@record
class CreepingLimits:
    """What creeping is.

    In the ladders of `abu_dhabi_2016`, `air_race_x_2024`, `rovinj_2014` and `half_cuban_eight`, 211 solves, fatrop
    never creeps by these limits. On a course of 18 phases it does in six solves of 62 to 502 iterations, and is
    found out after 7 to 27.

    Attributes:
        iterations: the number of successive iterations, outside of a restoration of feasibility.
        regularisation: the least that is added to the Hessian in all of them.
        infeasibility: the largest scaled infeasibility at all of them; far from feasible points curvature is negative
            in good earnest.
        change: the largest change of the objective over all of them, as a part of it or of 1.
    """

    iterations: int = 6
    regularisation: float = 0.1
    infeasibility: float = 0.01
    change: float = 3e-3


LIMITS = CreepingLimits()


class CreepingDetector:
    """A reader of fatrop's output.

    Attributes:
        creeping: whether it was seen to creep.
        barrier: last value of the barrier parameter; not a number before the first iteration.
    """

    def __init__(self) -> None:
        self.creeping = False
        self.barrier = math.nan
        self._line = ""
        self._objectives = deque[float](maxlen=LIMITS.iterations)  # of successive iterations that may be creeping

    def read(self, text: str) -> None:
        """Take a piece of the output, which may end anywhere within a line."""
        *lines, self._line = (self._line + text).split("\n")
        for line in lines:
            if match := _ITERATION.match(line):
                self.barrier = 10.0 ** float(match[4])
                self._count(not match[1], float(match[2]), float(match[3]), match[5])

    def _count(self, ordinary: bool, objective: float, infeasibility: float, regularisation: str) -> None:
        added = 0.0 if regularisation == "-" else 10.0 ** float(regularisation)
        if not (ordinary and infeasibility <= LIMITS.infeasibility and added >= LIMITS.regularisation):
            self._objectives.clear()
            return
        self._objectives.append(objective)
        if len(self._objectives) == LIMITS.iterations:
            change = abs(objective - self._objectives[0])
            self.creeping = self.creeping or change <= LIMITS.change * max(1.0, abs(objective))
