"""The list of fidelities and the stages that they fly."""

import copy
import pickle

import pytest

from airrace.dynamics.point_mass import build_point_mass
from airrace.procedure.fidelities import fidelity_of, register
from airrace.procedure.fidelity import Fidelity
from airrace.procedure.stage import STAGES, Stage

NAMES = ["homotopy", "point-mass", "transfer-function", "state-space-inversion", "state-space", "six-dof"]


def test_every_stage_is_flown_by_a_fidelity_of_its_own() -> None:
    assert [stage.value for stage in STAGES] == NAMES
    assert [fidelity_of(stage).stage for stage in STAGES] == list(STAGES)


@pytest.mark.parametrize("name", NAMES)
def test_stage_is_one_object_however_it_is_come_by(name: str) -> None:
    stage = Stage(name)
    assert stage.value == name
    assert copy.deepcopy(stage) is stage
    assert pickle.loads(pickle.dumps(stage)) is stage
    assert Stage.new(name, after=Stage.SIX_DOF) is stage


def test_stage_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="'seven-dof' is not the name of a stage"):
        Stage("seven-dof")


@pytest.mark.parametrize("name", ["", "Six-dof", "six dof", "six_dof", "-six", "../six"])
def test_stage_needs_a_name_that_can_be_typed_and_stored(name: str) -> None:
    with pytest.raises(ValueError, match="is no name for a stage"):
        Stage.new(name, after=Stage.SIX_DOF)


def test_stage_cannot_follow_what_is_no_optimum() -> None:
    with pytest.raises(ValueError, match="started from an optimum"):
        Stage.new("early", after=Stage.HOMOTOPY)


def test_stage_is_flown_by_one_fidelity_only() -> None:
    with pytest.raises(ValueError, match="a fidelity for the stage six-dof already"):
        register(fidelity_of(Stage.SIX_DOF))


def test_fidelity_without_a_controller_cannot_be_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airrace.procedure.stage._order", list(STAGES))
    with pytest.raises(ValueError, match="seven-dof has no inner loop"):
        register(Fidelity(Stage.new("seven-dof", after=Stage.SIX_DOF), build_point_mass))
    assert len(STAGES) == len(NAMES) + 1
