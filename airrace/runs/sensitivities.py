"""The prices of a stage, the largest first."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from airrace.errors import UsageError
from airrace.export.extras import extra
from airrace.inputs import Inputs
from airrace.procedure.result import StageResult
from airrace.report.sections import sensitivities_table
from airrace.sensitivity.lagrangian import prices
from airrace.sensitivity.sensitivity import ParameterGroup, Price

if TYPE_CHECKING:
    from pandas import DataFrame

SHOWN = 30
"""The largest number of prices that are shown; a data frame has all of them."""


@dataclass(frozen=True, repr=False)
class Prices(Mapping[str, Price]):
    """The prices of a stage by the keys of `set`, the largest first.

    Examples:
        >>> prices = run.sensitivities(by="rules")
        >>> prices["rules.n_z_max"].price < 0.0
        True

    Attributes:
        by_key: one per number that can be changed alone.
    """

    by_key: Mapping[str, Price]

    def __getitem__(self, key: str) -> Price:
        return self.by_key[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.by_key)

    def __len__(self) -> int:
        return len(self.by_key)

    def to_dataframe(self) -> "DataFrame":
        """Return all prices as a data frame of pandas, one row per key.

        An entry is empty where the inputs allow no value to that side.

        Raises:
            UsageError: pandas is not installed.
        """
        pandas: Any = extra("pandas", "a data frame")  # Any: without pandas there are no types
        rows = {key: price.as_object() for key, price in self.by_key.items()}
        return pandas.DataFrame.from_dict(rows, orient="index").rename_axis("key")

    def __repr__(self) -> str:
        return sensitivities_table(self.by_key, SHOWN).text()

    def _repr_html_(self) -> str:
        return sensitivities_table(self.by_key, SHOWN).html()


def priced(inputs: Inputs, result: StageResult, by: str | None = None) -> Prices:
    """Return the prices of a stage.

    Args:
        inputs: what the run was given.
        result: the stage.
        by: only the numbers of this group; None for all.

    Raises:
        UsageError: there is no such group, or course or aircraft were built in Python.
        NotCertified: the stage is no optimum, certified or solved.
    """
    known = {group.value: group for group in ParameterGroup}
    if by is not None and by not in known:
        raise UsageError(f"there are no sensitivities by {by!r}; known are {', '.join(known)}")
    groups = frozenset(ParameterGroup) if by is None else frozenset([known[by]])
    return Prices(prices(inputs, result, groups=groups))
