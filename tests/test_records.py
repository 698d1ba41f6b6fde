"""A record behaves as a frozen dataclass does, in all that can be seen of it."""

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from typing import Any, ClassVar

import pytest

from airrace.records import record

FROZEN = dataclasses.dataclass(frozen=True)


def made(decorator: Callable[[type], type]) -> type[Any]:
    """A class with fields of all kinds."""

    class Sample:
        shared: ClassVar[list[int]] = []
        x: float
        names: tuple[str, ...] = ()
        seen: int = dataclasses.field(default=0, compare=False)
        secret: str = dataclasses.field(default="", repr=False)
        counted: int = dataclasses.field(default=0, hash=False)

        def __post_init__(self) -> None:
            if self.x < 0.0:
                raise ValueError("x")

    Sample.__qualname__ = "Sample"
    return decorator(Sample)


@pytest.fixture(params=[record, FROZEN], ids=["record", "dataclass"])
def sample(request: pytest.FixtureRequest) -> type[Any]:
    return made(request.param)


def test_it_is_equal_where_its_compared_fields_are(sample: type[Any]) -> None:
    assert sample(1.0, ("a",)) == sample(1.0, ("a",), seen=3)
    assert sample(1.0) != sample(2.0)
    assert sample(1.0) != sample(1.0, counted=1)
    assert sample(1.0) != made(record)(1.0)
    assert sample(1.0) != 1.0


def test_its_hash_is_that_of_the_fields_that_count(sample: type[Any]) -> None:
    assert hash(sample(1.0)) == hash(sample(1.0, seen=3, counted=2))
    assert hash(sample(1.0)) != hash(sample(2.0))
    assert len({sample(1.0), sample(1.0), sample(2.0)}) == 2


def test_it_shows_what_is_to_be_shown(sample: type[Any]) -> None:
    assert repr(sample(1.0, ("a",), secret="b")) == "Sample(x=1.0, names=('a',), seen=0, counted=0)"


def test_nothing_of_it_can_be_set_or_deleted(sample: type[Any]) -> None:
    one = sample(1.0)
    for name in ("x", "names", "seen", "other"):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(one, name, 2)
        with pytest.raises(dataclasses.FrozenInstanceError):
            delattr(one, name)
    assert one == sample(1.0)


def test_it_is_made_checked_copied_and_described_as_a_dataclass(sample: type[Any]) -> None:
    one = sample(1.0, ("a",), 2)
    assert dataclasses.replace(one, x=3.0) == sample(3.0, ("a",))
    assert [field.name for field in dataclasses.fields(one)] == ["x", "names", "seen", "secret", "counted"]
    assert dataclasses.asdict(one) == {"x": 1.0, "names": ("a",), "seen": 2, "secret": "", "counted": 0}
    assert copy.deepcopy(one) == one
    assert copy.copy(one).seen == 2
    assert list(inspect.signature(sample).parameters) == ["x", "names", "seen", "secret", "counted"]
    with pytest.raises(ValueError, match="x"):
        sample(-1.0)
    with pytest.raises(ValueError, match="x"):
        dataclasses.replace(one, x=-1.0)
    assert sample.__match_args__ == ("x", "names", "seen", "secret", "counted")


@record
class Base:
    """A record that others are derived from; of the module, for pickle."""

    x: int


@record
class Derived(Base):
    """A record with one field more."""

    y: int = 0

    @property
    def total(self) -> int:
        return self.x + self.y


def test_a_derived_record_has_all_fields_and_is_none_of_its_base() -> None:
    assert Derived(1, 2).total == 3
    assert repr(Derived(1, 2)) == "Derived(x=1, y=2)"
    assert Derived(1) != Base(1)
    assert Derived(1) == Derived(1)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Derived(1).x = 2  # pyright: ignore[reportAttributeAccessIssue]


def test_it_survives_being_sent_to_another_process() -> None:
    assert pickle.loads(pickle.dumps(Derived(1, 2))) == Derived(1, 2)


@record(kw_only=True)
class Named:
    """A record whose fields are given by name, with a representation and an equality of its own."""

    x: int
    held: Any = None

    def __repr__(self) -> str:
        return "its own"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Named)


def test_methods_of_its_own_are_kept() -> None:
    assert repr(Named(x=1)) == "its own"
    assert Named(x=1) == Named(x=2)
    assert hash(Named(x=1)) == hash((1, None))  # as a frozen dataclass has it
    with pytest.raises(TypeError, match="positional"):
        Named(1)  # pyright: ignore[reportCallIssue]
