"""The stages of a run, by the names that users write, in their order."""

import re
from collections.abc import Sequence
from typing import Any, ClassVar, overload

from airrace.runtime.extensions import load_extensions

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
"""The form of a stage's name: lower-case words, joined by hyphens."""


class Stage:
    """A stage; there is one object per name, so stages are compared with `is`.

    `HOMOTOPY` is the assembled guess of the point mass, stored so that an interrupted run resumes behind it; it is
    neither an optimum nor certified. The others are optima, one per fidelity.
    """

    HOMOTOPY: ClassVar["Stage"]
    POINT_MASS: ClassVar["Stage"]
    TRANSFER_FUNCTION: ClassVar["Stage"]
    STATE_SPACE_INVERSION: ClassVar["Stage"]
    STATE_SPACE: ClassVar["Stage"]
    SIX_DOF: ClassVar["Stage"]

    __slots__ = ("_value",)
    _value: str

    def __new__(cls, value: str) -> "Stage":
        """Return the stage of a name.

        Raises:
            ValueError: there is none.
        """
        for stage in STAGES:
            if stage.value == value:
                return stage
        raise ValueError(f"{value!r} is not the name of a stage")

    @classmethod
    def new(cls, value: str, *, after: "Stage") -> "Stage":
        """Declare and return a further stage, solved after another one and before what followed that until now.

        A stage that exists already stays where it is.

        Args:
            value: its name: lower-case words, joined by hyphens.
            after: a stage whose result it can be started from: the point mass or one that comes later.

        Raises:
            ValueError: the name is not of that form, or nothing can be started from `after`.
        """
        if not NAME.fullmatch(value):
            raise ValueError(f"{value!r} is no name for a stage: lower-case words, joined by hyphens")
        if after is cls.HOMOTOPY:
            raise ValueError("a stage is started from an optimum, and the homotopy is none")
        known = next((one for one in _order if one.value == value), None)
        return known or _insert_stage(value, _order.index(after) + 1)

    @property
    def value(self) -> str:
        """The user's name."""
        return self._value

    def __repr__(self) -> str:
        return f"<Stage {self.value}>"

    def __reduce__(self) -> tuple[Any, ...]:  # Any: as the base class has it
        return Stage, (self.value,)


_order: list[Stage] = []


def _insert_stage(value: str, position: int) -> Stage:
    stage = object.__new__(Stage)
    stage._value = value  # pyright: ignore[reportPrivateUsage]  # it is the constructor
    _order.insert(position, stage)
    return stage


class _StageSequence(Sequence[Stage]):
    """All stages in order, those of extensions included."""

    @overload
    def __getitem__(self, index: int) -> Stage: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Stage, ...]: ...

    def __getitem__(self, index: int | slice) -> Stage | tuple[Stage, ...]:
        load_extensions()
        return tuple(_order)[index]

    def __len__(self) -> int:
        load_extensions()
        return len(_order)


STAGES: Sequence[Stage] = _StageSequence()
"""The stages in their order."""

Stage.HOMOTOPY = _insert_stage("homotopy", 0)
Stage.POINT_MASS = _insert_stage("point-mass", 1)
Stage.TRANSFER_FUNCTION = _insert_stage("transfer-function", 2)
Stage.STATE_SPACE_INVERSION = _insert_stage("state-space-inversion", 3)
Stage.STATE_SPACE = _insert_stage("state-space", 4)
Stage.SIX_DOF = _insert_stage("six-dof", 5)
