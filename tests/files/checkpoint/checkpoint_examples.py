"""Checkpoints to test with: a small fixed one, and hypothesis strategies for arbitrary ones."""

import dataclasses
import math
from dataclasses import replace
from enum import Enum

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from airrace.files.checkpoint import Checkpoint, ReserveAttempt, StoredDocument, StoredInputs
from airrace.files.checkpoint.run_layout import LARGEST
from airrace.optimal_control.certificate import Certificate, Curvature, Item, SecondOrder
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Trajectory
from airrace.procedure.result import (
    OUTCOMES,
    Attempt,
    GateSplit,
    Note,
    NoteKind,
    Route,
    SearchReport,
    StageResult,
    Status,
    Timings,
)
from airrace.procedure.stage import STAGES, Stage

INPUTS = StoredInputs(
    track=StoredDocument("tracks/šibenik.yaml", "schema: airrace/track/1\nname: Šibenik\n"),
    aircraft=StoredDocument("configs/edge540.yaml", "mass_kg: 560\n"),
    settings=None,
    overrides=("mesh.interval_s=0.2", "guess=plan"),
    resolved='{"course": {"gates": 2}}',
)
VERSIONS = {"airrace": "0.1.0", "casadi": "3.8.2", "numpy": "2.4.6", "python": "3.11.7"}


def example_result(stage: Stage = Stage.POINT_MASS, *, intervals: int = 6) -> StageResult:
    time = np.linspace(0.0, 3.0, intervals + 1)
    trajectory = Trajectory(
        phases=("start -> g1", "g1 -> finish"),
        first_node=np.array([0, intervals // 2, intervals], np.int64),
        durations=np.array([1.5, 1.5]),
        time=time,
        states=(Quantity("z", "m", 100.0, -500.0, -5.0, "down"), Quantity("V_K", "m/s", 50.0, 35.0, math.inf, "speed")),
        state=np.array([-20.0 - time, 90.0 + time]),
        controls=(Quantity("sink", "m/s", 5.0, text="how fast it sinks", rate_of="z"),),
        control=np.linspace(1.0, 9.0, intervals)[np.newaxis, :],
    )
    return StageResult(
        stage=stage,
        outcome=Status.SOLVED,
        message="solved",
        trajectory=trajectory,
        constraint_multipliers=np.linspace(-1.0, 1.0, 9),
        bound_multipliers=np.zeros(0),
        certificate=Certificate(
            "Solve_Succeeded",
            (Item("kkt_error", 1e-8, 1e-6), Item("replay", 1e-5, 1e-4, "", "g1")),
            SecondOrder(Curvature.SINGULAR, 1e-4, 2e-7, "g1 -> finish", "how fast it sinks", 5, 2),
        ),
        splits=(GateSplit("1:g1", 1.5, 91.5, 21.5, 4.0, 0.1, 0.0, 3.0),),
        attempts=(Attempt("joint", "interior-point", "0", True, 41, 0.5),),
        timings=Timings(0.5, 0.4, 0.9),
    )


EXPLORED = SearchReport(
    routes=(
        Route("g4 -> g5: over the top to the right, 140 m high", 54.6, 0.0, "joint"),
        Route("g4 -> g5: 180 degrees to the left, flat", 54.9, 0.3, "window"),
        Route("g4 -> g5: straight, flat, rolling left through level", 54.91, 0.31, "window", rolls=True),
    ),
    converged_to_best=3,
    converged_elsewhere=1,
    failed=1,
    seconds=4.5,
    loops=("g6 -> g7: turns 340 degrees on 900 m, where the gates ask for 20 degrees on 160 m",),
)


def contested() -> StageResult:
    """A stage with a search over routes and two alternatives."""
    alternatives = tuple(replace(example_result(intervals=count), message=f"alternative {count}") for count in (4, 8))
    return replace(example_result(), search=EXPLORED, alternatives=alternatives)


def example_checkpoint(*stages: Stage, intervals: int = 6) -> Checkpoint:
    checkpoint = Checkpoint(INPUTS, VERSIONS)
    for stage in stages or (Stage.HOMOTOPY, Stage.POINT_MASS):
        checkpoint = checkpoint.with_stage(example_result(stage, intervals=intervals))
    return checkpoint


def with_attempts(checkpoint: Checkpoint) -> Checkpoint:
    """The checkpoint with two attempts of a reserve, the second of which has found no flight."""
    one = ReserveAttempt('{"probability":0.9}', 1000, 90, 80, 20, 0.1, 1.0, 0.5, done=False)
    flown = checkpoint.with_attempt(one, ("margins.rules.floor_m=0.5",), example_result(STAGES[-1]))
    return flown.with_attempt(dataclasses.replace(one, flights=0, broken=0, outside=0, over_g=0, lift=0.0), (), None)


def assert_same(one: object, other: object, where: str = "") -> None:
    """Equality in every bit, NaN included."""
    assert type(one) is type(other), where
    if dataclasses.is_dataclass(one):
        for field in dataclasses.fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name), f"{where}.{field.name}")
    elif isinstance(one, tuple):
        assert len(one) == len(other), where
        for index, (left, right) in enumerate(zip(one, other, strict=True)):
            assert_same(left, right, f"{where}[{index}]")
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape), where
        assert one.tobytes() == other.tobytes(), where
    elif isinstance(one, float):
        assert np.float64(one).tobytes() == np.float64(other).tobytes(), where
    elif isinstance(one, Enum):
        assert one is other, where
    else:
        assert one == other, where


# Paths that are not UTF-8 hold lone surrogates from U+DC80 to U+DCFF.
texts = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)
paths = st.builds(
    lambda text, byte: text + bytes([byte]).decode("utf-8", "surrogateescape"), texts, st.integers(1, 255)
)
numbers = st.floats(allow_nan=True, allow_infinity=True)
counts = st.integers(-(2**53), 2**53)
names = st.from_regex(r"\A[A-Za-z_][A-Za-z0-9_]{0,8}\Z")


def records(kind: type, **fields: st.SearchStrategy[object]) -> st.SearchStrategy[tuple[object, ...]]:
    return st.lists(st.builds(kind, **fields), max_size=3).map(tuple)


items = records(Item, name=texts, value=numbers, limit=numbers, unit=texts, where=texts)
certificates = st.none() | st.builds(Certificate, texts, items)
split_numbers = dict.fromkeys(("time", "V_K", "height", "n_z", "bank", "climb", "heading"), numbers)
attempts = records(
    Attempt, purpose=texts, solver=texts, status=texts, success=st.booleans(), iterations=counts, seconds=numbers
)


def arrays(*shape: int) -> st.SearchStrategy[np.ndarray]:
    return hnp.arrays(np.float64, shape, elements=numbers)


def declarations(count: int) -> st.SearchStrategy[tuple[Quantity, ...]]:
    declared = st.builds(Quantity, names, texts, numbers, numbers, numbers, texts)
    return st.lists(declared, min_size=count, max_size=count, unique_by=lambda quantity: quantity.name).map(tuple)


@st.composite
def results(draw: st.DrawFn, stage: Stage) -> StageResult:
    """Any stage: where a flight was found, one that can be flown."""
    result = draw(_any_results(stage))
    return with_possible_numbers(result) if result.is_flight else result


def with_possible_numbers(result: StageResult) -> StageResult:
    """The same with finite numbers, and time that passes."""
    flown = result.trajectory
    lengths = np.diff(flown.first_node)
    durations = 0.5 + lengths
    parts = [duration / length for duration, length in zip(durations, lengths, strict=True) for _ in range(length)]
    possible = dataclasses.replace(
        flown,
        durations=durations,
        time=np.concatenate(([0.0], np.cumsum(parts))),
        state=_possible(flown.state),
        control=_possible(flown.control),
    )
    multipliers = _possible(result.constraint_multipliers)
    splits = tuple(GateSplit(one.name, *_possible(np.array(_numbers(one))).tolist()) for one in result.splits)
    return dataclasses.replace(result, trajectory=possible, constraint_multipliers=multipliers, splits=splits)


def _numbers(split: GateSplit) -> list[float]:
    """All but the name."""
    _, *values = dataclasses.astuple(split)
    return values


def _possible(values: np.ndarray) -> np.ndarray:
    return np.clip(np.nan_to_num(values), -LARGEST, LARGEST)


@st.composite
def trajectories(draw: st.DrawFn) -> Trajectory:
    lengths = draw(st.lists(st.integers(1, 4), min_size=1, max_size=3))
    first_node = np.concatenate(([0], np.cumsum(lengths))).astype(np.int64)
    n_x, n_u, intervals = draw(st.integers(0, 4)), draw(st.integers(0, 3)), int(first_node[-1])
    return Trajectory(
        phases=tuple(draw(texts) for _ in lengths),
        first_node=first_node,
        durations=draw(arrays(len(lengths))),
        time=draw(arrays(intervals + 1)),
        states=draw(declarations(n_x)),
        state=draw(arrays(n_x, intervals + 1)),
        controls=draw(declarations(n_u)),
        control=draw(arrays(n_u, intervals)),
    )


def _any_results(stage: Stage) -> st.SearchStrategy[StageResult]:
    return st.builds(
        StageResult,
        stage=st.just(stage),
        outcome=st.sampled_from(OUTCOMES),
        message=texts,
        trajectory=trajectories(),
        constraint_multipliers=arrays(3),
        bound_multipliers=arrays(0),
        certificate=certificates,
        splits=records(GateSplit, name=texts, **split_numbers),
        attempts=attempts,
        timings=st.builds(Timings, numbers, numbers, numbers),
        notes=st.lists(st.builds(Note, st.sampled_from(NoteKind), texts), max_size=2).map(tuple),
    )


@st.composite
def checkpoints(draw: st.DrawFn) -> Checkpoint:
    documents = st.builds(StoredDocument, paths, texts)
    inputs = st.builds(
        StoredInputs, documents, documents, st.none() | documents, st.lists(texts, max_size=3).map(tuple), texts
    )
    checkpoint = Checkpoint(draw(inputs), draw(st.dictionaries(texts, texts, max_size=3)))
    for stage in draw(st.lists(st.sampled_from(STAGES), unique=True, max_size=2)):
        checkpoint = checkpoint.with_stage(draw(results(stage)))
    return checkpoint
