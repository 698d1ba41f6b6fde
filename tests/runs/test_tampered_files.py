"""`verify` finds what was edited in a checkpoint whose checksum and hashes were computed anew."""

import contextlib
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import Ran, run
from tampered_checkpoints import FOUND, TRANSFER, UNVERIFIABLE, genuine, last, resealed, versions

import airrace
from airrace.errors import CheckpointError, NotCertified
from airrace.files.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from airrace.procedure.stage import Stage
from airrace.runs.run_state import open_run
from airrace.runs.verification import verify_run

pytestmark = pytest.mark.usefixtures("measured_once")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.h5"


def objections(checkpoint: Checkpoint, path: Path) -> str:
    """What the reader of a file refuses or `verify` finds; empty if nothing."""
    try:
        write_checkpoint(path, checkpoint)
        verdicts = verify_run(open_run(path), versions=True)
    except CheckpointError as error:
        return str(error)
    return "; ".join(verdict.objection for verdict in verdicts if verdict.objection)


def test_genuine_run_is_verified(path: Path) -> None:
    assert objections(genuine(), path) == ""
    assert objections(resealed(genuine(), [stored.result for stored in genuine().stages]), path) == ""


WORDS = {
    "times of splits": "gate split 1:vertical, time: ",
    "names of legs": "a leg is called '0:entry -> 1:vertical!'",
    "KKT error divided": "certificate, kkt_error: ",
    "limits a tenth lower": "certificate, limit of kkt_error: 9e-07 is stored, 1e-06 was measured",
    "change of race time": "certificate, race_time_change: ",
    "drift of the mesh": "mesh, drift ",
    "another version": "casadi 1.0",
    "first stage dropped": "missing: homotopy",
    "a message": "says nothing like 'the fastest flight",
    "a note on a simpler route": "says nothing like 'approved by the race director'",
    "an alternative that is the flight itself": "an alternative is the flight itself",
}


@pytest.mark.parametrize("name", FOUND)
def test_tampering_is_found_and_what_differs_is_named(name: str, path: Path) -> None:
    assert WORDS.keys() <= FOUND.keys()
    objection = objections(FOUND[name](genuine()), path)
    assert objection
    assert WORDS.get(name, "") in objection


def test_unverifiable_numbers_are_listed_as_such(path: Path) -> None:
    for tamper in UNVERIFIABLE.values():
        assert objections(tamper(genuine()), path) == ""
    verified = run("verify", path)
    assert verified.code == 0
    assert "unverified, for they cannot be measured again: messages and notes, attempts and timings, " in verified.out
    assert "Not verifiable: messages and notes, attempts and timings, " in run("show", path, "--certificate").out


def test_run_of_other_versions_is_verified_on_request_but_for_these(path: Path) -> None:
    write_checkpoint(path, versions(numpy="1.26.0")(genuine()))
    refused = run("verify", path)
    assert refused.code == 5
    assert "it is said to be made with numpy 1.26.0 (here " in refused.err
    allowed = run("verify", path, "--other-versions", "--json").answer
    assert allowed["verified"] is True
    assert "versions" in allowed["unverified"]


def test_run_with_a_broken_chain_is_shown_as_not_certified_everywhere(path: Path) -> None:
    """The stages are stored as certified, and their hashes are those of another flight."""
    tampered = last("splits.*.time", 0.5)(genuine())
    hashes = {stored.result.stage: stored.chain_hash for stored in genuine().stages}
    stages = tuple(replace(stored, chain_hash=hashes[stored.result.stage]) for stored in tampered.stages)
    write_checkpoint(path, replace(tampered, stages=stages))
    assert open_run(path)[TRANSFER].result.certificate is not None
    for text in (run("show", path).out, repr(open_run(path)), repr(open_run(path)[TRANSFER])):
        assert "certified" not in text.replace("NOT certified", "").replace("not certified", "")
    answer = run("show", path, "--json").answer
    assert (answer["certified"], answer["verified"]) == (False, None)
    assert [stage["certified"] for stage in answer["stages"]] == [False, False, False]
    assert "it no longer stands: its record" in answer["stages"][-1]["message"]
    assert open_run(path).flight().source.certified is False
    assert "# certified: no" in open_run(path)[TRANSFER].to_csv()
    with pytest.raises(NotCertified):
        airrace.open(path).sensitivities()


READERS = (
    ("show",),
    ("verify",),
    ("export", "csv"),
    ("export", "kml"),
    ("report",),
    ("compare",),
    ("plot",),
    ("sensitivity",),
    ("resume", "--dry-run"),
)


@pytest.mark.parametrize("command", READERS, ids=" ".join)
def test_missing_history_is_refused_by_every_command(command: Sequence[str], path: Path) -> None:
    write_checkpoint(path, FOUND["a state missing"](genuine()))
    files = (path, path) if command == ("compare",) else (path,)
    refused = in_folder(path.parent, *command, *files)
    assert (refused.code, refused.err) == (7, "airrace: transfer-function: the state z is missing\n")


def in_folder(folder: Path, *arguments: str | Path) -> Ran:
    with contextlib.chdir(folder):
        return run(*arguments)


def test_start_from_a_run_of_other_equations_is_still_possible(path: Path) -> None:
    """It takes what its model has, and skips the rest."""
    write_checkpoint(path, FOUND["a state missing"](genuine()))
    assert read_checkpoint(path).stage(Stage.POINT_MASS) is not None
    dry = in_folder(path.parent, "resume", path, "--set", "rules.n_z_max=9", "--output", "new.h5", "--dry-run")
    assert dry.code == 0


def test_histories_from_which_infinite_speeds_follow_are_refused(path: Path) -> None:
    row = [quantity.name for quantity in genuine().stages[-1].result.trajectory.states].index("n_z")

    def loaded(state: np.ndarray) -> np.ndarray:
        state = state.copy()
        state[row, 3] = 1e29
        return state

    write_checkpoint(path, last("trajectory.state", loaded)(genuine()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refused = run("show", "--legs", path)
    assert refused.code == 7, refused.err
    assert "its histories are of no flight" in refused.err
