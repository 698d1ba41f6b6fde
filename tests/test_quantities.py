"""Declared scalars, ranges and typed vectors."""

import copy
import dataclasses
import inspect
import math
import pickle
from collections.abc import Callable
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.frames import angle_between, angles, normalise, product, quaternion, quaternion_rates, rotation
from airrace.quantities import Interval, Quantity, T, Vector, quantity, vector
from airrace.records import record
from airrace.system import at_points

finite = st.floats(-1e6, 1e6)
intervals = st.builds(lambda a, b: Interval(min(a, b), max(a, b)), finite, finite)


@vector
class Position(Vector[T]):
    """Two declared components."""

    x: T = quantity("m", scale=100.0, text="north")
    y: T = quantity("m", scale=50.0, lower=-1.0, upper=1.0, text="east")


@vector
class Motion(Position[T]):
    """A position with one component more."""

    V: T = quantity("m/s", scale=10.0)


def test_declarations_stand_beside_the_names_and_an_extension_appends_its_own() -> None:
    assert Position.quantities() == (
        Quantity("x", "m", scale=100.0, text="north"),
        Quantity("y", "m", scale=50.0, lower=-1.0, upper=1.0, text="east"),
    )
    assert Motion.names() == ("x", "y", "V")
    assert Motion.size() == 3
    assert Motion.quantities()[:2] == Position.quantities()


def test_split_undoes_join_of_numbers_histories_and_symbols() -> None:
    history = np.arange(6.0).reshape(3, 2)
    assert list(Motion.split(history).V) == [4.0, 5.0]
    assert list(Motion.split(history[:, 0]).join()) == history[:, 0].tolist()
    column = ca.SX.sym("m", 3)
    assert ca.is_equal(ca.vertcat(*Motion.split(column).join()), column, 1)


def test_vectors_are_frozen_and_made_by_keyword_only() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Position(x=1.0, y=2.0).x = 3.0  # type: ignore[misc]  # the point of the test
    with pytest.raises(TypeError):
        Position(1.0, 2.0)  # type: ignore[misc]  # the point of the test


@given(intervals, intervals, finite)
def test_intersection_holds_what_both_hold(a: Interval, b: Interval, value: float) -> None:
    both = a.intersect(b)
    assert (both.lower <= value <= both.upper) == (a.lower <= value <= a.upper and b.lower <= value <= b.upper)
    assert a.intersect(Interval()) == a


def test_ranges_may_be_empty_or_unbounded() -> None:
    assert Interval(0.0, 1.0).intersect(Interval(2.0, 3.0)).empty
    assert not Interval.exactly(2.0).empty
    assert Interval(upper=1.0).bounded
    assert not Interval().bounded
    assert Interval().lower == -math.inf


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


def test_it_is_compared_hashed_and_shown_by_the_fields_that_count(sample: type[Any]) -> None:
    assert sample(1.0, ("a",)) == sample(1.0, ("a",), seen=3)
    assert sample(1.0) != sample(2.0)
    assert sample(1.0) != sample(1.0, counted=1)
    assert sample(1.0) != made(record)(1.0)
    assert sample(1.0) != 1.0
    assert hash(sample(1.0)) == hash(sample(1.0, seen=3, counted=2))
    assert len({sample(1.0), sample(1.0), sample(2.0)}) == 2
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


def test_a_derived_record_has_all_fields_is_none_of_its_base_and_can_be_pickled() -> None:
    assert Derived(1, 2).total == 3
    assert repr(Derived(1, 2)) == "Derived(x=1, y=2)"
    assert Derived(1) != Base(1)
    assert Derived(1) == Derived(1)
    assert pickle.loads(pickle.dumps(Derived(1, 2))) == Derived(1, 2)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Derived(1).x = 2  # pyright: ignore[reportAttributeAccessIssue]


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


RANDOM = np.random.default_rng(3)


def example(*, sparse: bool = False) -> ca.Function:
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    found = ca.vertcat(ca.sin(x[0]) * p[1], 0.0 if sparse else x[2] ** 2, ca.atan2(x[1], x[2]) + p[0])
    return ca.Function("example", [x, p], [ca.sparsify(found) if sparse else found])


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("count", [1, 7, 400])
def test_result_has_the_bits_of_a_call_of_casadi(count: int, sparse: bool) -> None:
    function = example(sparse=sparse)
    x, p = RANDOM.normal(size=(3, count)), RANDOM.normal(size=(2, count))
    assert np.array_equal(at_points(function, x, p), np.asarray(function.map(count)(x, p)))


def test_points_may_share_an_argument_lie_in_any_layout_and_have_arguments_of_nothing() -> None:
    x, p = RANDOM.normal(size=(5, 6)).T[::2], RANDOM.normal(size=2)
    found = at_points(example(), x, p)
    assert np.array_equal(found, at_points(example(), x, np.repeat(p[:, None], 5, axis=1)))
    assert np.array_equal(found, at_points(example(), np.ascontiguousarray(x), p))
    symbol, none = ca.SX.sym("x", 2), ca.SX.sym("p", 0)
    twice = ca.Function("twice", [symbol, none], [2.0 * symbol])
    assert np.array_equal(at_points(twice, x[:2], np.zeros(0)), 2.0 * x[:2])
    with pytest.raises(ValueError, match="argument 1 of example has 3 rows"):
        at_points(example(), np.zeros((3, 2)), np.zeros(3))


any_angle = st.floats(-3.1, 3.1)
climbs = st.floats(-1.5, 1.5)
attitudes = st.builds(quaternion, any_angle, climbs, any_angle)
rates = st.tuples(*[st.floats(-7.0, 7.0)] * 3)


@given(attitudes, attitudes, st.floats(0.1, 10.0))
def test_rotation_is_orthonormal_whatever_the_length_of_its_quaternion_and_composed_by_products(
    p: list[float], q: list[float], length: float
) -> None:
    R, stretched = np.array(rotation(q)), [-length * component for component in q]
    assert np.array(rotation(stretched)) == pytest.approx(R, abs=1e-12)
    assert pytest.approx(np.eye(3), abs=1e-12) == R @ R.T
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-12)
    assert np.array(rotation(product(p, q))) == pytest.approx(np.array(rotation(p)) @ R, abs=1e-12)
    unit = normalise(stretched)
    assert math.hypot(*unit) == pytest.approx(1.0, rel=1e-14)
    assert np.array(rotation(unit)) == pytest.approx(R, abs=1e-12)


@given(any_angle, climbs, any_angle)
def test_angles_make_the_round_trip_through_the_quaternion(chi: float, gamma: float, mu: float) -> None:
    assert angles(rotation(quaternion(chi, gamma, mu))) == pytest.approx((chi, gamma, mu), abs=1e-9)


@given(attitudes, rates)
def test_quaternion_rates_turn_the_matrix_by_the_rates_in_the_rotated_frame_and_keep_the_length(
    q: list[float], omega: tuple[float, float, float]
) -> None:
    p, q_rate, r = omega
    cross = np.array([[0.0, -r, q_rate], [r, 0.0, -p], [-q_rate, p, 0.0]])
    step, q_dot = 1e-6, quaternion_rates(q, *omega)
    after = rotation([a + step * b for a, b in zip(q, q_dot, strict=True)])
    before = rotation([a - step * b for a, b in zip(q, q_dot, strict=True)])
    R_dot = (np.array(after) - np.array(before)) / (2.0 * step)
    assert R_dot == pytest.approx(np.array(rotation(q)) @ cross, abs=1e-7)
    assert np.dot(q, q_dot) == pytest.approx(0.0, abs=1e-12)
    assert q_dot == pytest.approx([0.5 * one for one in product(q, [0.0, *omega])], abs=1e-14)


@pytest.mark.parametrize(
    ("chi", "gamma", "mu", "axis", "expected"),
    [
        (math.pi / 2, 0.0, 0.0, 0, (0.0, 1.0, 0.0)),  # a course counts from north to east
        (0.0, 0.5, 0.0, 0, (math.cos(0.5), 0.0, -math.sin(0.5))),  # a climb points the velocity up
        (0.0, 0.0, 0.3, 1, (0.0, math.cos(0.3), math.sin(0.3))),  # a bank to the right lowers the right wing
        (1.1, 0.0, math.pi / 2, 1, (0.0, 0.0, 1.0)),  # knife edge right
        (1.1, 0.0, -math.pi / 2, 1, (0.0, 0.0, -1.0)),  # knife edge left
        (1.1, 0.0, math.pi, 2, (0.0, 0.0, -1.0)),  # inverted
    ],
)
def test_axes_point_where_course_climb_and_bank_turn_them(
    chi: float, gamma: float, mu: float, axis: int, expected: tuple[float, ...]
) -> None:
    assert np.array(rotation(quaternion(chi, gamma, mu)))[:, axis] == pytest.approx(expected, abs=1e-15)


def test_rotation_serves_symbols_and_numbers_alike() -> None:
    q = ca.SX.sym("q", 4)
    R = rotation(ca.vertsplit(q))
    function = ca.Function("R", [q], [ca.vertcat(*(ca.horzcat(*row) for row in R))])
    numbers = [0.3, -0.2, 0.9, 0.4]
    assert np.array(function(numbers)) == pytest.approx(np.array(rotation(numbers)), abs=1e-15)


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_angle_between_is_the_shortest_turn(a: float, b: float) -> None:
    turn = angle_between(a, b)
    assert abs(turn) <= math.pi
    assert math.cos(b + turn) == pytest.approx(math.cos(a), abs=1e-9)
    assert math.sin(b + turn) == pytest.approx(math.sin(a), abs=1e-9)
