"""Checkpoints: round trips, stored routes, and what is stale."""

import dataclasses
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from checkpoint_examples import (
    EXPLORED,
    INPUTS,
    VERSIONS,
    assert_same,
    checkpoints,
    contested,
    counts,
    example_checkpoint,
    example_result,
    numbers,
    records,
    results,
    texts,
    with_attempts,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from airrace.errors import CheckpointError
from airrace.files.checkpoint import Checkpoint, inputs_hash, read_checkpoint, stale_stages, write_checkpoint
from airrace.files.checkpoint.checkpoint import content_digest
from airrace.files.checkpoint.store import BLOCK_SIZE
from airrace.optimal_control.certificate import Item
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Trajectory
from airrace.procedure.result import (
    BoundedWindow,
    LowerBound,
    PylonCondition,
    PylonSide,
    Route,
    SearchReport,
    StageResult,
    Status,
    SuggestedChange,
)
from airrace.procedure.stage import Stage


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(checkpoint=checkpoints())
def test_reading_gives_back_every_bit_that_was_written(checkpoint: Checkpoint, tmp_path_factory) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.h5"
    write_checkpoint(path, checkpoint)
    read = read_checkpoint(path)
    assert_same(checkpoint.inputs, read.inputs)
    assert dict(checkpoint.versions) == dict(read.versions)
    assert_same(checkpoint.stages, read.stages)
    assert stale_stages(read, inputs_hash(read.inputs.resolved)) == []


def test_equal_checkpoints_make_equal_files(tmp_path: Path) -> None:
    for name in ("one.h5", "other.h5"):
        write_checkpoint(tmp_path / name, example_checkpoint())
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "other.h5").read_bytes()


def test_a_long_race_with_long_texts_survives(tmp_path: Path) -> None:
    inputs = replace(INPUTS, overrides=("a=1",) * 50, resolved="{" + " " * 300_000 + "}")
    checkpoint = Checkpoint(inputs, VERSIONS).with_stage(example_result(intervals=20_000))
    write_checkpoint(tmp_path / "long.h5", checkpoint)
    read = read_checkpoint(tmp_path / "long.h5")
    assert_same(checkpoint.inputs, read.inputs)
    assert_same(checkpoint.stages, read.stages)


def test_plain_hdf5_opens_the_file_behind_its_user_block(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    write_checkpoint(path, example_checkpoint())
    with h5py.File(path, "r") as file:
        assert file.userblock_size == BLOCK_SIZE
        stage = file["stages/point-mass"]
        speed = stage["states/V_K"]
        np.testing.assert_array_equal(speed, example_result().trajectory["V_K"])
        assert (speed.attrs["units"], speed.attrs["long_name"]) == (b"m/s", b"speed")
        assert np.isposinf(speed.attrs["upper"])
        np.testing.assert_array_equal(speed.dims[0][0], stage["time"])
        np.testing.assert_array_equal(stage["controls/sink"].dims[0]["interval_time"], stage["interval_time"])
        assert stage["controls/sink"].attrs["rate_of"] == b"z"
        assert file["inputs/track/text"][()].decode() == INPUTS.track.text
        assert stage["certificate/items"]["name"].tolist() == [b"kkt_error", b"replay"]


@pytest.mark.parametrize("name", ["a/b", "..", "", "2nd", "n\0z", "x" * 65, "V_K"])
def test_a_quantity_whose_name_cannot_name_a_dataset_is_refused(tmp_path: Path, name: str) -> None:
    flight = example_result().trajectory
    flight = replace(flight, states=(Quantity(name, "m"), flight.states[1]))
    with pytest.raises(CheckpointError, match="cannot be stored"):
        write_checkpoint(tmp_path / "run.h5", checkpoint_of(flight))
    assert list(tmp_path.iterdir()) == []


CONTRADICTORY = replace(example_result().trajectory, first_node=np.array([0, 2, 99], np.int64))


def test_what_could_not_be_read_again_never_replaces_a_good_checkpoint(tmp_path: Path) -> None:
    path, good = tmp_path / "run.h5", example_checkpoint()
    write_checkpoint(path, good)
    before = path.read_bytes()
    longer = good.with_stage(replace(example_result(Stage.STATE_SPACE), trajectory=CONTRADICTORY))
    nul = Checkpoint(replace(INPUTS, resolved="a\0b"), VERSIONS)
    for refused, words in ((checkpoint_of(CONTRADICTORY), "first_node"), (nul, "NUL"), (longer, "first_node")):
        with pytest.raises(CheckpointError, match=words):
            write_checkpoint(path, refused)
        assert path.read_bytes() == before
        assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(CheckpointError, match="first_node"):  # of a stage that the file has not
        write_checkpoint(path, longer, before=good)


def checkpoint_of(trajectory: Trajectory) -> Checkpoint:
    return Checkpoint(INPUTS, VERSIONS).with_stage(replace(example_result(), trajectory=trajectory))


STAGE = "stages/point-mass"
routes = records(Route, text=texts, race_time=numbers, difference=numbers, evaluated_by=texts, rolls=st.booleans())
explored = st.builds(
    SearchReport,
    routes,
    converged_to_best=counts,
    converged_elsewhere=counts,
    failed=counts,
    seconds=numbers,
    loops=st.lists(texts, max_size=3).map(tuple),
)


def checkpoint_with(result: StageResult) -> Checkpoint:
    return Checkpoint(INPUTS, VERSIONS).with_stage(result)


@st.composite
def explored_results(draw: st.DrawFn) -> StageResult:
    own = replace(draw(results(Stage.POINT_MASS)), search=draw(explored))
    alternatives = draw(st.lists(results(Stage.POINT_MASS), max_size=3))
    return replace(own, alternatives=tuple(alternatives))


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(result=explored_results())
def test_routes_and_alternatives_are_read_back_in_every_bit(
    result: StageResult, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "routes.h5"
    write_checkpoint(path, checkpoint_with(result))
    (stored,) = read_checkpoint(path).stages
    assert_same(stored.result, result)


BOUND = LowerBound(49.0, 50.0, 3, 17, 400, 30, (BoundedWindow("a -> b", 3, 1.0, 15),))


@pytest.mark.parametrize("bound", [BOUND, replace(BOUND, seconds=0.0, windows=(), stopped=True)])
def test_lower_bound_is_read_back(tmp_path: Path, bound: LowerBound) -> None:
    result = replace(example_result(), search=replace(EXPLORED, bound=bound))
    write_checkpoint(tmp_path / "run.h5", checkpoint_with(result))
    (stored,) = read_checkpoint(tmp_path / "run.h5").stages
    assert stored.result.search == result.search


@pytest.mark.parametrize(
    "other",
    [
        {"race_time": 0.0, "seconds": 0.0},
        {"seconds": 51.0},
        {"seconds": math.nan},
        {"windows": ()},
        {"windows": (), "stopped": True},
    ],
)
def test_lower_bounds_that_no_search_leads_to_are_refused(tmp_path: Path, other: dict[str, Any]) -> None:
    result = replace(example_result(), search=replace(EXPLORED, bound=replace(BOUND, **other)))
    with pytest.raises(CheckpointError, match=r"/search/bound: no lower bound"):
        write_checkpoint(tmp_path / "run.h5", checkpoint_with(result))


def test_what_would_resolve_conflicts_is_read_back_and_is_absent_where_nothing_is_reported(tmp_path: Path) -> None:
    suggested_change = SuggestedChange(1, "1:g6 -> 1:g7", "rules.n_z_max", "n_z", "g", 3.0, 3.4, 56.2)
    failed = replace(
        example_result(),
        outcome=Status.INFEASIBLE,
        suggested_changes=(suggested_change, replace(suggested_change, conflict=2)),
    )
    for result in (failed, example_result()):
        write_checkpoint(tmp_path / "run.h5", checkpoint_with(result))
        (stored,) = read_checkpoint(tmp_path / "run.h5").stages
        assert stored.result.suggested_changes == result.suggested_changes
        with h5py.File(tmp_path / "run.h5", "r") as file:
            assert ("suggested_changes" in file[STAGE]) == bool(result.suggested_changes)


def test_attempts_of_a_reserve_are_read_back_and_are_absent_where_none_is_made(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    plain = example_checkpoint()
    tried = with_attempts(plain)
    for checkpoint in (plain, tried):
        write_checkpoint(path, checkpoint)
        with h5py.File(path) as file:
            assert ("reserve" in file) == (checkpoint is tried)
    assert_same(read_checkpoint(path), tried)
    assert len(read_checkpoint(path).standing_attempts('{"probability":0.9}')) == 2
    assert read_checkpoint(path).standing_attempts('{"probability":0.8}') == ()


@pytest.mark.parametrize(
    "other",
    [{"outside": 1001}, {"over_g": -1}, {"risk": -0.1}, {"load_weight": math.inf}, {"lift": math.nan}, {"flights": 0}],
)
def test_attempts_that_no_search_can_have_made_are_refused(tmp_path: Path, other: dict[str, Any]) -> None:
    tried = with_attempts(example_checkpoint())
    first = tried.attempts[0]
    impossible = replace(first, attempt=replace(first.attempt, **other))
    with pytest.raises(CheckpointError, match=r"/reserve/1/"):
        write_checkpoint(tmp_path / "run.h5", replace(tried, attempts=(impossible,)))


def test_a_stage_computed_or_checked_again_drops_the_attempts_that_were_made_from_it() -> None:
    tried = with_attempts(example_checkpoint())
    assert tried.with_stage(example_result(Stage.POINT_MASS)).attempts == ()
    assert tried.with_mesh_check(example_result(Stage.POINT_MASS)).attempts == ()
    changed = replace(tried, stages=(*tried.stages[:-1], replace(tried.stages[-1], chain_hash="0")))
    assert changed.standing_attempts('{"probability":0.9}') == ()


def test_conditions_on_pylons_are_read_back_and_are_absent_where_nothing_is_asked(tmp_path: Path) -> None:
    conditions = tuple(
        PylonCondition("g1", post, 0, 1.0 / 3.0, side, 0.02, -7.5) for post, side in enumerate(PylonSide)
    )
    for result in (replace(example_result(), pylon_conditions=conditions), example_result()):
        write_checkpoint(tmp_path / "run.h5", checkpoint_with(result))
        (stored,) = read_checkpoint(tmp_path / "run.h5").stages
        assert stored.result.pylon_conditions == result.pylon_conditions
        with h5py.File(tmp_path / "run.h5", "r") as file:
            assert ("pylon_conditions" in file[STAGE]) == bool(result.pylon_conditions)


@pytest.mark.parametrize(
    "other",
    [
        {"leg": 99},
        {"leg": -1},
        {"share": 1.5},
        {"share": math.nan},
        {"error": math.inf},
        {"roll_acceleration": math.nan},
    ],
)
def test_conditions_on_pylons_that_no_flight_can_have_are_refused(tmp_path: Path, other: dict[str, Any]) -> None:
    condition = replace(PylonCondition("g1", 0, 0, 1.0, PylonSide.LEFT, 0.0), **other)
    with pytest.raises(CheckpointError, match="pylon_conditions"):
        write_checkpoint(tmp_path / "run.h5", checkpoint_with(replace(example_result(), pylon_conditions=(condition,))))


def test_more_than_nine_alternatives_keep_their_order(tmp_path: Path) -> None:
    messages = [f"alternative {number}" for number in range(12)]
    alternatives = tuple(replace(example_result(), message=message) for message in messages)
    write_checkpoint(tmp_path / "run.h5", checkpoint_with(replace(example_result(), alternatives=alternatives)))
    (stored,) = read_checkpoint(tmp_path / "run.h5").stages
    assert [alternative.message for alternative in stored.result.alternatives] == messages


def test_plain_hdf5_shows_routes_and_alternatives(tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "run.h5", checkpoint_with(contested()))
    with h5py.File(tmp_path / "run.h5", "r") as file:
        stage = file[STAGE]
        assert stage["search/routes"]["text"][0].decode() == EXPLORED.routes[0].text
        assert stage["search/routes"]["difference"].tolist() == [0.0, 0.3, 0.31]
        assert stage["search/routes"]["rolls"].tolist() == [0, 0, 1]
        assert list(stage["alternatives"]) == ["1", "2"]
        # The time axis of an alternative's histories is its own.
        assert stage["alternatives/2/states/V_K"].dims[0][0] == stage["alternatives/2/time"]


def test_a_stage_stands_on_its_routes_and_alternatives() -> None:
    """What is computed from them is stale where they are others."""
    link = checkpoint_with(contested()).stages[0].chain_hash
    first, second = contested().alternatives
    slower = replace(EXPLORED, routes=(EXPLORED.routes[0], replace(EXPLORED.routes[1], race_time=55.0)))
    others = (
        replace(contested(), search=slower),
        replace(contested(), alternatives=(second, first)),
        replace(contested(), alternatives=(first,)),
        replace(contested(), alternatives=(first, replace(second, message="another"))),
    )
    assert checkpoint_with(contested()).stages[0].chain_hash == link
    for other in others:
        assert checkpoint_with(other).stages[0].chain_hash != link


CURRENT = inputs_hash(INPUTS.resolved)
RUN_STAGES = (Stage.HOMOTOPY, Stage.POINT_MASS, Stage.TRANSFER_FUNCTION)


def stale_names(checkpoint: Checkpoint) -> list[Stage]:
    return [stage for stage, _ in stale_stages(checkpoint, CURRENT)]


def test_another_configuration_makes_every_stage_stale() -> None:
    assert stale_stages(example_checkpoint(*RUN_STAGES), CURRENT) == []
    stale = stale_stages(example_checkpoint(*RUN_STAGES), inputs_hash("{}"))
    assert [stage for stage, _ in stale] == list(RUN_STAGES)
    assert all(reason == "the resolved configuration changed since it was computed" for _, reason in stale)


def test_a_stage_computed_before_the_change_makes_the_later_ones_stale_too() -> None:
    old = example_checkpoint(Stage.HOMOTOPY)
    changed = replace(old, inputs=replace(INPUTS, resolved="{}")).with_stage(example_result(Stage.POINT_MASS))
    stale = stale_stages(changed, inputs_hash("{}"))
    assert stale == [
        (Stage.HOMOTOPY, "the resolved configuration changed since it was computed"),
        (Stage.POINT_MASS, "a stage before it changed (homotopy)"),
    ]


def test_a_changed_number_makes_its_stage_and_all_later_ones_stale() -> None:
    checkpoint = example_checkpoint(*RUN_STAGES)
    first, second, third = checkpoint.stages
    flight = second.result.trajectory
    state = flight.state.copy()
    state[1, 3] = np.nextafter(state[1, 3], 0.0)
    altered = replace(second, result=replace(second.result, trajectory=replace(flight, state=state)))
    stale = stale_stages(replace(checkpoint, stages=(first, altered, third)), CURRENT)
    assert [stage for stage, _ in stale] == [Stage.POINT_MASS, Stage.TRANSFER_FUNCTION]
    assert "its record" in stale[0][1]
    assert stale[1][1] == "a stage before it changed (point-mass)"


def test_a_stage_exchanged_for_another_run_s_does_not_fit_the_chain() -> None:
    checkpoint = example_checkpoint(*RUN_STAGES)
    other = example_checkpoint(Stage.HOMOTOPY, intervals=8)
    mixed = replace(checkpoint, stages=(other.stages[0], *checkpoint.stages[1:]))
    assert stale_names(mixed) == [Stage.POINT_MASS, Stage.TRANSFER_FUNCTION]


def test_a_stage_computed_again_replaces_itself_and_drops_what_stood_on_it_but_one_that_was_checked_does_not() -> None:
    checkpoint = example_checkpoint(*RUN_STAGES)
    result = example_result(Stage.POINT_MASS, intervals=8)
    for replaced, stages in (
        (checkpoint.with_stage(result), RUN_STAGES[:2]),
        (checkpoint.with_mesh_check(result), RUN_STAGES),
    ):
        assert [stored.result.stage for stored in replaced.stages] == list(stages)
        assert replaced.stages[0] is checkpoint.stages[0]
        assert len(replaced.stages[1].result.trajectory.time) == 9
        assert [one.result for one in replaced.stages[2:]] == [one.result for one in checkpoint.stages[2 : len(stages)]]
        assert stale_names(replaced) == []


def test_a_completed_mesh_check_makes_no_stale_stage_good_again() -> None:
    checkpoint, result = example_checkpoint(*RUN_STAGES), example_result(Stage.POINT_MASS, intervals=8)
    first, second, third = checkpoint.stages
    altered = replace(third, result=replace(third.result, message="altered"))
    assert stale_names(replace(checkpoint, stages=(first, second, altered)).with_mesh_check(result)) == [
        third.result.stage
    ]
    assert len(stale_stages(checkpoint.with_mesh_check(result), inputs_hash("{}"))) == len(RUN_STAGES)


def test_a_stage_is_found_by_its_name() -> None:
    checkpoint = example_checkpoint(Stage.POINT_MASS)
    assert checkpoint.stage(Stage.POINT_MASS) is checkpoint.stages[0]
    assert checkpoint.stage(Stage.SIX_DOF) is None


def test_the_chain_tells_the_same_result_on_another_ground_apart() -> None:
    alone = Checkpoint(INPUTS, VERSIONS).with_stage(example_result())
    after_homotopy = example_checkpoint(Stage.HOMOTOPY, Stage.POINT_MASS)
    assert alone.stages[0].chain_hash != after_homotopy.stages[1].chain_hash


def test_a_digest_does_not_confuse_neighbouring_texts() -> None:
    assert content_digest(("ab", "c")) != content_digest(("a", "bc"))
    assert content_digest((("a",), "b")) != content_digest(("a", ("b",)))
    assert content_digest(Item("1", 0.0, 1.0)) != content_digest(Item("", 0.0, 1.0, "1"))


def test_a_digest_sees_numbers_as_they_are_stored() -> None:
    assert content_digest(Item("a", 1, 2)) == content_digest(Item("a", np.float64(1.0), 2.0))
    assert content_digest(np.arange(3, dtype=np.int32)) == content_digest(np.arange(3, dtype=np.int64))
    assert content_digest(np.arange(3)) != content_digest(np.arange(3.0))
    assert content_digest(True) != content_digest(1)
    with pytest.raises(TypeError, match="set"):
        content_digest({1})


def test_a_digest_leaves_out_what_a_quantity_does_not_declare() -> None:
    fields = ("name", "unit", "scale", "lower", "upper", "text")  # of a quantity as it was once stored
    before = dataclasses.make_dataclass("Quantity", fields)
    assert content_digest(Quantity("eta", "rad")) == content_digest(before("eta", "rad", 1.0, -math.inf, math.inf, ""))
    assert content_digest(Quantity("eta", "rad")) != content_digest(Quantity("eta", "rad", rate_of="xi"))
