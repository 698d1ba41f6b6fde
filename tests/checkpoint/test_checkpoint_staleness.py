"""Which stages can still be trusted, and why the others cannot."""

import dataclasses
import math
from dataclasses import replace

import numpy as np
import pytest
from checkpoint_examples import INPUTS, VERSIONS, example_checkpoint, example_result

from airrace.checkpoint import Checkpoint, inputs_hash, stale_stages
from airrace.checkpoint.checkpoint import content_digest
from airrace.optimal_control.certificate import Item
from airrace.procedure.result import Stage
from airrace.quantities import Quantity

CURRENT = inputs_hash(INPUTS.resolved)
LADDER = (Stage.HOMOTOPY, Stage.POINT_MASS, Stage.TRANSFER_FUNCTION)


def test_nothing_is_stale_while_nothing_changed() -> None:
    assert stale_stages(example_checkpoint(*LADDER), CURRENT) == []


def test_another_configuration_makes_every_stage_stale() -> None:
    stale = stale_stages(example_checkpoint(*LADDER), inputs_hash("{}"))
    assert [stage for stage, _ in stale] == list(LADDER)
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
    checkpoint = example_checkpoint(*LADDER)
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
    checkpoint = example_checkpoint(*LADDER)
    other = example_checkpoint(Stage.HOMOTOPY, intervals=8)
    mixed = replace(checkpoint, stages=(other.stages[0], *checkpoint.stages[1:]))
    assert [stage for stage, _ in stale_stages(mixed, CURRENT)] == [Stage.POINT_MASS, Stage.TRANSFER_FUNCTION]


def test_a_stage_computed_again_replaces_itself_and_drops_what_stood_on_it() -> None:
    checkpoint = example_checkpoint(*LADDER)
    again = checkpoint.with_stage(example_result(Stage.POINT_MASS, intervals=8))
    assert [stored.result.stage for stored in again.stages] == [Stage.HOMOTOPY, Stage.POINT_MASS]
    assert again.stages[0] is checkpoint.stages[0]
    assert len(again.stages[1].result.trajectory.time) == 9
    assert stale_stages(again, CURRENT) == []


def test_a_completed_proof_takes_the_place_of_its_stage_and_what_stood_above_stands() -> None:
    checkpoint = example_checkpoint(*LADDER)
    proved = checkpoint.with_proof(example_result(Stage.POINT_MASS, intervals=8))
    assert [stored.result.stage for stored in proved.stages] == list(LADDER)
    assert proved.stages[0] is checkpoint.stages[0]
    assert len(proved.stages[1].result.trajectory.time) == 9
    assert proved.stages[2].result is checkpoint.stages[2].result
    assert stale_stages(proved, CURRENT) == []


def test_a_completed_proof_makes_no_stale_stage_good_again() -> None:
    checkpoint = example_checkpoint(*LADDER)
    first, second, third = checkpoint.stages
    altered = replace(third, result=replace(third.result, message="altered"))
    proved = replace(checkpoint, stages=(first, second, altered)).with_proof(
        example_result(Stage.POINT_MASS, intervals=8)
    )
    assert [stage for stage, _ in stale_stages(proved, CURRENT)] == [Stage.TRANSFER_FUNCTION]
    computed_otherwise = checkpoint.with_proof(example_result(Stage.POINT_MASS, intervals=8))
    assert len(stale_stages(computed_otherwise, inputs_hash("{}"))) == len(LADDER)


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


def test_a_digest_leaves_out_what_a_quantity_does_not_declare() -> None:
    fields = ("name", "unit", "scale", "lower", "upper", "text")  # of a quantity as it was once stored
    before = dataclasses.make_dataclass("Quantity", fields)
    assert content_digest(Quantity("eta", "rad")) == content_digest(before("eta", "rad", 1.0, -math.inf, math.inf, ""))
    assert content_digest(Quantity("eta", "rad")) != content_digest(Quantity("eta", "rad", rate_of="xi"))


def test_a_digest_of_an_unknown_kind_is_refused() -> None:
    with pytest.raises(TypeError, match="set"):
        content_digest({1})
