"""Over-g: the pulls of a flight that count as the rules of its race count them.

A season's rules name a ladder: how long a load factor beyond the limit may last, and a second load factor that ends
the race at once. Where they name none, every pull beyond the limit counts. The aircraft's own limits count however
short the pull is, and so do pushes.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.flights.results.penalties import ENDS_RACE, NONE_KNOWN, Penalties
from airrace.optimal_control.trajectory import Array
from airrace.race import Race

LOAD_ALLOWED = 0.1
"""What is allowed beyond a load factor, g: the noise of an accelerometer in turbulence."""


@dataclass(frozen=True)
class LoadRule:
    """Which pulls count.

    Attributes:
        lower: the load factor below which a push counts.
        upper: that beyond which a pull counts which lasts for `lasting`, s.
        at_once: that beyond which any pull counts.
        penalty: of a pull that lasts, s; infinity where it ends the race, None where no rule states it.
        ends: that beyond which a pull ends the race by the rules; infinity where none does.
    """

    lower: float
    upper: float
    lasting: float
    at_once: float
    penalty: float | None
    ends: float = math.inf

    @classmethod
    def from_penalties(cls, race: Race, penalties: Penalties = NONE_KNOWN) -> "LoadRule":
        """Return the rule of a race with the penalties of its season; those of a pilot's comfort are no rules."""
        rules, aircraft = race.course.rules.n_z, race.aircraft.envelope.n_z
        lower, ends = max(rules.lower, aircraft.lower), penalties.load_factor_end
        if penalties.load_factor is None and ends is None:  # no ladder
            return cls(lower, min(rules.upper, aircraft.upper), 0.0, math.inf, None)
        ends = math.inf if ends is None else ends
        above, at_once = penalties.load_factor_from or rules.upper, min(ends, aircraft.upper)
        return cls(lower, above, penalties.load_factor_time, at_once, penalties.load_factor, ends)

    @property
    def text(self) -> str:
        """The rule as a clause, e.g. `more than 10 g for 0.6 s; more than 12 g at once, which ends the race`."""
        lasting = f" for {self.lasting:g} s" if self.lasting else ""
        cost = "" if self.penalty is None else f", which costs {self.penalty:g} s"
        if self.penalty == ENDS_RACE:
            cost = ", which ends the race"
        texts = [f"more than {self.upper:g} g{lasting}{cost}"]
        if self.at_once < self.ends and (self.lasting or self.at_once < self.upper):
            texts.append(f"more than {self.at_once:g} g at once, which is the aircraft's limit")
        if math.isfinite(self.ends) and (self.lasting or self.penalty != ENDS_RACE):
            texts.append(f"more than {self.ends:g} g at once, which ends the race")
        return "; ".join([*texts, f"less than {self.lower:g} g"])

    def counted(self, load: Array, sample: float) -> NDArray[np.bool_]:
        """Return at which samples a pull counts, shape (K, n).

        What lasts counts at the sample with which it begins to last.

        Args:
            load: load factors, shape (K, n).
            sample: time between samples, s.
        """
        above = load > self.upper + LOAD_ALLOWED
        count = round(self.lasting / sample) + 1
        lasts = np.zeros_like(above)
        if count <= len(above):
            sums = np.cumsum(np.concatenate([np.zeros((1, above.shape[1]), np.int64), above]), axis=0)
            lasts[: len(above) - count + 1] = sums[count:] - sums[:-count] == count
        return np.asarray(lasts | (load > self.at_once + LOAD_ALLOWED) | (load < self.lower - LOAD_ALLOWED))

    def pulls(self, load: Array, sample: float, counts: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return at which samples a pull begins to count, shape (K, n): once for as long as the load stays beyond.

        Args:
            load, sample: see `counted`.
            counts: the samples that are looked at, shape (K, n).
        """
        counted = self.counted(load, sample) & counts
        above = load > min(self.upper, self.at_once) + LOAD_ALLOWED
        beyond = above.astype(np.int8) - (load < self.lower - LOAD_ALLOWED)  # -1 where it pushes
        before = np.concatenate([np.zeros((1, load.shape[1]), np.int8), beyond[:-1]])
        counted_so_far = np.cumsum(counted, axis=0)
        counted_earlier = np.where((beyond != 0) & (beyond != before), counted_so_far - counted, 0)
        in_this_pull = counted_so_far - np.maximum.accumulate(counted_earlier, axis=0)
        return np.asarray(counted & (in_this_pull == 1))
