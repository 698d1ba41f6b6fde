"""Routes that were tried and alternatives are stored with a stage, and read only in the layout in which they are."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from checkpoint_examples import (
    INPUTS,
    VERSIONS,
    assert_same,
    counts,
    example_checkpoint,
    example_result,
    numbers,
    records,
    results,
    texts,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from airrace.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from airrace.checkpoint.store import seal, unseal
from airrace.errors import CheckpointError
from airrace.procedure.result import NOT_SEARCHED, Outcome, Route, SearchReport, Stage, StageResult, SuggestedChange

EXPLORED = SearchReport(
    routes=(
        Route("g4 -> g5: over the top to the right, 140 m high", 54.6, 0.0, "joint"),
        Route("g4 -> g5: 180 degrees to the left, flat", 54.9, 0.3, "window"),
    ),
    converged_to_best=3,
    converged_elsewhere=1,
    failed=1,
    seconds=4.5,
    loops=("g6 -> g7: turns 340 degrees on 900 m, where the gates ask for 20 degrees on 160 m",),
)
STAGE = "stages/point-mass"
routes = records(Route, text=texts, race_time=numbers, difference=numbers, evaluated_by=texts)
explored = st.builds(
    SearchReport,
    routes,
    converged_to_best=counts,
    converged_elsewhere=counts,
    failed=counts,
    seconds=numbers,
    loops=st.lists(texts, max_size=3).map(tuple),
)


def contested() -> StageResult:
    """A stage that was explored, with two alternatives."""
    alternatives = tuple(replace(example_result(intervals=count), message=f"alternative {count}") for count in (4, 8))
    return replace(example_result(), search=EXPLORED, alternatives=alternatives)


def checkpoint_of(result: StageResult) -> Checkpoint:
    return Checkpoint(INPUTS, VERSIONS).with_stage(result)


@st.composite
def explored_results(draw: st.DrawFn) -> StageResult:
    own = replace(draw(results(Stage.POINT_MASS)), search=draw(explored))
    alternatives = draw(st.lists(results(Stage.POINT_MASS), max_size=3))
    return replace(own, alternatives=tuple(alternatives))


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(result=explored_results())
def test_ways_and_rivals_are_read_back_in_every_bit(
    result: StageResult, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "ways.h5"
    write_checkpoint(path, checkpoint_of(result))
    (stored,) = read_checkpoint(path).stages
    assert_same(stored.result, result)


def test_stage_that_explored_nothing_is_read_back_as_such(tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "run.h5", example_checkpoint())
    for stored in read_checkpoint(tmp_path / "run.h5").stages:
        assert stored.result.search == NOT_SEARCHED
        assert stored.result.alternatives == ()


def test_what_would_resolve_conflicts_is_read_back_and_is_absent_where_nothing_is_told(tmp_path: Path) -> None:
    suggested_change = SuggestedChange(1, "1:g6 -> 1:g7", "rules.n_z_max", "n_z", "g", 3.0, 3.4, 56.2)
    failed = replace(
        example_result(),
        outcome=Outcome.INFEASIBLE,
        suggested_changes=(suggested_change, replace(suggested_change, conflict=2)),
    )
    for result in (failed, example_result()):
        write_checkpoint(tmp_path / "run.h5", checkpoint_of(result))
        (stored,) = read_checkpoint(tmp_path / "run.h5").stages
        assert stored.result.suggested_changes == result.suggested_changes
        with h5py.File(tmp_path / "run.h5", "r") as file:
            assert ("suggested_changes" in file[STAGE]) == bool(result.suggested_changes)


def test_more_than_nine_rivals_keep_their_order(tmp_path: Path) -> None:
    alternatives = tuple(replace(example_result(), message=f"alternative {number}") for number in range(12))
    write_checkpoint(tmp_path / "run.h5", checkpoint_of(replace(example_result(), alternatives=alternatives)))
    (stored,) = read_checkpoint(tmp_path / "run.h5").stages
    assert [alternative.message for alternative in stored.result.alternatives] == [
        alternative.message for alternative in alternatives
    ]


def test_plain_hdf5_shows_ways_and_rivals(tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "run.h5", checkpoint_of(contested()))
    with h5py.File(tmp_path / "run.h5", "r") as file:
        stage = file[STAGE]
        assert stage["search/routes"]["text"][0].decode() == EXPLORED.routes[0].text
        assert stage["search/routes"]["difference"].tolist() == [0.0, 0.3]
        assert list(stage["alternatives"]) == ["1", "2"]
        # The time axis of an alternative's histories is its own.
        assert stage["alternatives/2/states/V_K"].dims[0][0] == stage["alternatives/2/time"]


def renew(file: h5py.File, name: str, data: np.ndarray) -> None:
    del file[name]
    file.create_dataset(name, data=data)


FORGERIES: dict[str, tuple[Callable[[h5py.File], object], str]] = {
    "unknown member": (lambda f: f.create_group(f"{STAGE}/search/more"), "'more' is unknown"),
    "no routes": (lambda f: f.pop(f"{STAGE}/search/routes"), "'routes' is missing"),
    "no summary": (lambda f: f.pop(f"{STAGE}/search/summary"), "'summary' is missing"),
    "two summaries": (
        lambda f: renew(f, f"{STAGE}/search/summary", np.repeat(f[f"{STAGE}/search/summary"][()], 2)),
        "summary: 2 rows instead of one",
    ),
    "loops of numbers": (lambda f: renew(f, f"{STAGE}/search/loops", np.zeros(2)), "loops"),
    "routes of other columns": (
        lambda f: renew(f, f"{STAGE}/search/routes", np.zeros(1, [("text", "S2"), ("race_time", "<f8")])),
        "routes",
    ),
    "nothing explored": (lambda f: f.pop(f"{STAGE}/search"), "'search' is missing"),
    "no alternatives' group": (lambda f: f.pop(f"{STAGE}/alternatives"), "'alternatives' is missing"),
    "a gap between alternatives": (
        lambda f: f.move(f"{STAGE}/alternatives/1", f"{STAGE}/alternatives/3"),
        "'3' is unknown|'1' is missing",
    ),
    "alternatives counted from zero": (
        lambda f: f.move(f"{STAGE}/alternatives/1", f"{STAGE}/alternatives/0"),
        "'0' is unknown|'1' is missing",
    ),
    "an alternative with a name": (
        lambda f: f.move(f"{STAGE}/alternatives/2", f"{STAGE}/alternatives/best"),
        "'best' is unknown|'2' is missing",
    ),
    "an alternative with alternatives": (
        lambda f: f.create_group(f"{STAGE}/alternatives/1/alternatives"),
        "'alternatives' is unknown",
    ),
    "an alternative with hashes": (
        lambda f: f.copy(f"{STAGE}/inputs_hash", f"{STAGE}/alternatives/1/inputs_hash"),
        "'inputs_hash' is unknown",
    ),
    "an alternative without a flight": (lambda f: f.pop(f"{STAGE}/alternatives/1/states"), "'states' is missing"),
    "an alternative that is a series": (
        lambda f: (f.pop(f"{STAGE}/alternatives/1"), f.create_dataset(f"{STAGE}/alternatives/1", data=np.zeros(3))),
        "1 is not a group",
    ),
    "an alternative with an unknown outcome": (
        lambda f: renew(f, f"{STAGE}/alternatives/1/outcome", np.array(b"fine", h5py.string_dtype("utf-8", 4))),
        "unknown outcome 'fine'",
    ),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_forged_ways_and_rivals_are_refused(tmp_path: Path, name: str) -> None:
    path, image = tmp_path / "run.h5", tmp_path / "image.h5"
    write_checkpoint(path, checkpoint_of(contested()))
    image.write_bytes(unseal(path.read_bytes()))
    edit, words = FORGERIES[name]
    with h5py.File(image, "r+") as file:
        edit(file)
    path.write_bytes(seal(image.read_bytes()))
    with pytest.raises(CheckpointError, match=words) as caught:
        read_checkpoint(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_stage_stands_on_its_ways_and_rivals() -> None:
    """What is computed from them is stale where they are others."""
    link = checkpoint_of(contested()).stages[0].chain_hash
    first, second = contested().alternatives
    slower = replace(EXPLORED, routes=(EXPLORED.routes[0], replace(EXPLORED.routes[1], race_time=55.0)))
    others = (
        replace(contested(), search=slower),
        replace(contested(), alternatives=(second, first)),
        replace(contested(), alternatives=(first,)),
        replace(contested(), alternatives=(first, replace(second, message="another"))),
    )
    assert checkpoint_of(contested()).stages[0].chain_hash == link
    for other in others:
        assert checkpoint_of(other).stages[0].chain_hash != link
