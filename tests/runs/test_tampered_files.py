"""A stranger who can seal a file and link its stages again does not make `verify` believe what is not so."""

import contextlib
import json
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from tampered_checkpoints import FOUND, TRANSFER, UNVERIFIABLE, flown, genuine, last, resealed, splits, versions
from typer.testing import CliRunner

import airrace
from airrace.cli.main import app
from airrace.errors import CheckpointError, NotCertified
from airrace.files.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from airrace.optimal_control.trajectory import Trajectory
from airrace.procedure.stage import Stage
from airrace.runs.run import open_run
from airrace.runs.verification import verify_run

pytestmark = pytest.mark.usefixtures("measured_once")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.h5"


def objections(checkpoint: Checkpoint, path: Path, *, versions: bool = True) -> str:
    """What speaks against a file: what its reader says, or what `verify` does; empty if nothing."""
    try:
        write_checkpoint(path, checkpoint)
        found = verify_run(open_run(path), versions=versions)
    except CheckpointError as error:
        return str(error)
    return "; ".join(one.objection for one in found if one.objection)


def test_genuine_run_is_verified(path: Path) -> None:
    assert objections(genuine(), path) == ""
    assert objections(resealed(genuine(), [one.result for one in genuine().stages]), path) == ""


WORDS = {
    "splits halved": "gate split 1:vertical, time: ",
    "names of legs": "a leg is called '0:entry -> 1:vertical!'",
    "error of optimality divided": "certificate, kkt_error: ",
    "limits a tenth lower": "certificate, limit of kkt_error: 9e-07 is stored, 1e-06 was measured",
    "drift of the mesh": "mesh, drift ",
    "version of casadi": "casadi 1.0",
    "first stage dropped": "missing: homotopy",
    "a message": "says nothing like 'the fastest flight",
}


@pytest.mark.parametrize("name", FOUND)
def test_tampering_is_found_and_what_differs_is_named(name: str, path: Path) -> None:
    assert WORDS.keys() <= FOUND.keys()
    found = objections(FOUND[name](genuine()), path)
    assert found
    assert WORDS.get(name, "") in found


def test_hearsay_is_not_found_and_called_unverified(path: Path) -> None:
    for change in UNVERIFIABLE.values():
        assert objections(change(genuine()), path) == ""
    told = ran("verify", path)
    assert told.exit_code == 0
    assert "unverified, for they cannot be measured again: messages, attempts and timings, " in told.stdout
    assert "Not verifiable: messages, attempts and timings, " in ran("show", path, "--certificate").stdout


def test_run_of_other_versions_is_verified_on_request_but_for_these(path: Path) -> None:
    write_checkpoint(path, versions(numpy="1.26.0")(genuine()))
    refused = ran("verify", path)
    assert refused.exit_code == 5
    assert "it is said to be made with numpy 1.26.0 (here " in refused.stderr
    allowed = json.loads(ran("verify", path, "--other-versions", "--json").stdout)
    assert allowed["verified"] is True
    assert "versions" in allowed["unverified"]


def test_broken_chain_is_not_called_certified(path: Path) -> None:
    """By whatever shows the flight: the stages are stored as certified, and their links are of another flight."""
    changed = last(splits(time=0.5))(genuine())
    linked = {one.result.stage: one.chain_hash for one in genuine().stages}
    stages = tuple(replace(one, chain_hash=linked[one.result.stage]) for one in changed.stages)
    write_checkpoint(path, replace(changed, stages=stages))
    assert open_run(path)[TRANSFER].result.certificate is not None
    for texts in (ran("show", path).stdout, repr(open_run(path)), repr(open_run(path)[TRANSFER])):
        assert "certified" not in texts.replace("NOT certified", "").replace("not certified", "")
    shown = json.loads(ran("show", path, "--json").stdout)
    assert (shown["certified"], shown["verified"]) == (False, None)
    assert [stage["certified"] for stage in shown["stages"]] == [False, False, False]
    assert "it no longer stands: its record" in shown["stages"][-1]["message"]
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
def test_missing_history_is_one_sentence_of_every_reader(command: Sequence[str], path: Path) -> None:
    write_checkpoint(path, FOUND["a state missing"](genuine()))
    files = (path, path) if command == ("compare",) else (path,)
    refused = ran(*command, *files)
    assert refused.exit_code == 7, refused.output
    assert refused.stderr == "airrace: transfer-function: the state z is missing\n"


def test_start_from_a_run_of_other_equations_is_still_possible(path: Path) -> None:
    """It takes what its model knows, and what it does not know is no start."""
    write_checkpoint(path, FOUND["a state missing"](genuine()))
    assert read_checkpoint(path).stage(Stage.POINT_MASS) is not None
    dry = ran("resume", path, "--set", "rules.n_z_max=9", "--output", path.with_name("new.h5"), "--dry-run")
    assert dry.exit_code == 0


def ran(*arguments: str | Path):
    with contextlib.chdir(Path(str(next(one for one in arguments if isinstance(one, Path)))).parent):
        return CliRunner().invoke(app, [str(one) for one in arguments])


def test_histories_from_which_infinite_speeds_follow_are_refused_in_a_sentence(path: Path) -> None:
    def loaded(one: Trajectory) -> Trajectory:
        state = one.state.copy()
        state[[each.name for each in one.states].index("n_z"), 3] = 1e29
        return replace(one, state=state)

    write_checkpoint(path, last(flown(loaded))(genuine()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refused = ran("show", "--legs", path)
    assert refused.exit_code == 7, refused.output
    assert "its histories are of no flight" in refused.stderr
