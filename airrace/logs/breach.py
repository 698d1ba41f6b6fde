"""A breach: a rule that a flown run would break."""

from airrace.records import record

SURE = 3.0
"""The number of standard deviations of a measurement beyond which a breach is taken for certain.

An optimum touches its limits at many gates, and of two standard deviations every fortieth such passing exceeds them.
"""


@record
class Breach:
    """A rule that a flight would break.

    Attributes:
        passing: the name of the passage; empty for the flight as a whole.
        rule: `pylon`, `missed`, `too-high`, `too-low`, `bank`, `climb`, `course`, `manoeuvre`, `start-speed`,
            `load-factor`, `crowd`, `safety-line`, `airspace`, `floor` or `ceiling`.
        time: when, s after the start; NaN where it did not happen at a time.
        value, limit: what was flown and what is allowed, in `unit`.
        deviation: standard deviation of the value; NaN where it is not known.
        unit: `m`, `deg`, `kt`, `g` or empty.
        penalty: s; infinity where the race is over, NaN where the rules name none.
    """

    passing: str
    rule: str
    time: float
    value: float
    limit: float
    deviation: float
    unit: str
    penalty: float

    @property
    def certain(self) -> bool:
        """Whether the breach is larger than what the measurement may be wrong by."""
        return not abs(self.value - self.limit) < SURE * self.deviation  # certain where that is not known
