"""Damaged and forged files: every one ends in a `CheckpointError`, none in another exception, a hang or a crash."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
import pytest
from checkpoint_examples import assert_same, example_checkpoint

from airrace.errors import CheckpointError
from airrace.files.checkpoint import read_checkpoint, store, write_checkpoint
from airrace.files.checkpoint.store import BLOCK_SIZE, seal, unseal

STAGE = "stages/point-mass"


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "run.h5"
    write_checkpoint(path, example_checkpoint())
    return path.read_bytes()


def assert_refused(path: Path, content: bytes, words: str | None = None) -> None:
    path.write_bytes(content)
    with pytest.raises(CheckpointError, match=words) as caught:
        read_checkpoint(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_checkpoint_of_another_length_is_refused(sealed: bytes, tmp_path: Path) -> None:
    lengths = {*range(0, 600, 7), *range(600, len(sealed), 401), 511, 512, 513, len(sealed) - 1}
    for length in sorted(lengths):
        assert_refused(tmp_path / "run.h5", sealed[:length])
    assert_refused(tmp_path / "run.h5", sealed + b"\0", "damaged")


def test_any_flipped_bit_is_refused(sealed: bytes, tmp_path: Path) -> None:
    positions = [*range(BLOCK_SIZE), *range(BLOCK_SIZE, len(sealed), 97), len(sealed) - 1]
    for position in positions:
        flipped = bytearray(sealed)
        flipped[position] ^= 1 << position % 8
        assert_refused(tmp_path / "run.h5", bytes(flipped))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "not a"),
        (b"schema: airrace/track/1\n" * 100, "not a"),
        (b"\x89HDF\r\n\x1a\n" + b"\0" * 4000, "not a"),
        (seal(b"nothing of the kind" * 99), "HDF5"),
    ],
    ids=["empty", "text", "HDF5", "sealed"],
)
def test_other_files_are_no_checkpoints(content: bytes, words: str, tmp_path: Path) -> None:
    assert_refused(tmp_path / "run.h5", content, words)


def test_what_is_no_file_is_refused_with_a_sentence(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.h5")
    (tmp_path / "loop.h5").symlink_to("loop.h5")
    for path, words in (
        (tmp_path / "none.h5", r"there is no checkpoint .*none\.h5$"),
        (tmp_path / "loop.h5", r"the checkpoint .*loop\.h5 cannot be read: too many levels"),
        (tmp_path, "cannot be read|not a regular file"),
        (tmp_path / "pipe.h5", "not a regular file"),
        (Path("/dev/zero"), "not a regular file"),
    ):
        with pytest.raises(CheckpointError, match=words):
            read_checkpoint(path)


def test_a_file_beyond_the_size_limit_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "run.h5").open("wb") as file:
        file.truncate(store.SIZE_MAX + 1)
    with pytest.raises(CheckpointError, match="larger than 256 MiB"):
        read_checkpoint(tmp_path / "run.h5")


def forged(sealed: bytes, path: Path, edit: Callable[[h5py.File], None]) -> bytes:
    """The checkpoint, edited by someone who can compute checksums."""
    path.write_bytes(unseal(sealed))
    with h5py.File(path, "r+") as file:
        edit(file)
    return seal(path.read_bytes())


def renew(file: h5py.File, name: str, **dataset: object) -> None:
    del file[name]
    file.create_dataset(name, **dataset)


def soft_link(file: h5py.File) -> None:
    del file[f"{STAGE}/durations"]
    file[f"{STAGE}/durations"] = h5py.SoftLink("/stages/homotopy/durations")


def external_link(file: h5py.File) -> None:
    del file[f"{STAGE}/durations"]
    file[f"{STAGE}/durations"] = h5py.ExternalLink("/etc/passwd", "/durations")


def virtual_dataset(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((2,), "<f8")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", (2,), "<f8")
    del file[f"{STAGE}/durations"]
    file.create_virtual_dataset(f"{STAGE}/durations", layout)


def repeated_alternatives(file: h5py.File, count: int) -> None:
    """One flight under many names."""
    flight = file.create_group("flight")
    for name in set(file[STAGE]) - {"alternatives", "inputs_hash", "chain_hash"}:
        flight[name] = file[STAGE][name]
    for number in range(1, count + 1):
        file[f"{STAGE}/alternatives/{number}"] = flight
    del file["flight"]


def repeated_bytes(file: h5py.File) -> None:
    renew(file, f"{STAGE}/bound_multipliers", data=np.zeros(50_000))
    repeated_alternatives(file, 20)


def add_states(file: h5py.File, values: Mapping[str, float]) -> None:
    like = file[f"{STAGE}/states/V_K"]
    for row, (name, value) in enumerate(values.items(), 2):
        added = file.create_dataset(f"{STAGE}/states/{name}", data=np.full(like.shape, value))
        for key in ("units", "long_name"):
            added.attrs.create(key, like.attrs[key], dtype=utf8(len(like.attrs[key])))
        for key in ("scale", "lower", "upper"):
            added.attrs[key] = like.attrs[key]
        added.attrs["row"] = np.int64(row)


def shorten_history(file: h5py.File) -> None:
    attributes = dict(file[f"{STAGE}/states/V_K"].attrs)
    renew(file, f"{STAGE}/states/V_K", data=np.zeros(3))
    for name in ("scale", "lower", "upper", "row"):
        file[f"{STAGE}/states/V_K"].attrs[name] = attributes[name]
    for name in ("units", "long_name"):
        file[f"{STAGE}/states/V_K"].attrs.create(name, attributes[name], dtype=utf8(len(attributes[name])))


def set_mesh(file: h5py.File, why: int, coarser: int, intervals: int = 6) -> None:
    for name, data in (
        ("why", np.full(intervals, why)),
        ("coarser", np.full(intervals + 1, coarser)),
        ("defect", np.zeros(intervals)),
        ("drift", np.zeros(intervals)),
    ):
        renew(file, f"{STAGE}/mesh/{name}", data=data)


def set_time(file: h5py.File, time: Sequence[float]) -> None:
    file[f"{STAGE}/time"][:] = time
    file[f"{STAGE}/interval_time"][:] = time[:-1]


FORGERIES: dict[str, tuple[Callable[[h5py.File], object], str]] = {
    "soft link": (soft_link, "durations: is a soft or external link"),
    "external link": (external_link, "durations: is a soft or external link"),
    "external storage": (
        lambda f: renew(f, f"{STAGE}/durations", shape=(2,), dtype="<f8", external=[("/etc/passwd", 0, 16)]),
        "not stored plainly",
    ),
    "virtual dataset": (virtual_dataset, "not stored plainly"),
    "object reference": (
        lambda f: renew(f, f"{STAGE}/durations", data=np.array([f.ref, f.ref], h5py.ref_dtype)),
        "durations is not a series of floats",
    ),
    "reference as attribute": (
        lambda f: f[f"{STAGE}/states/V_K"].attrs.create("units", f.ref),
        "V_K@units is not a short text",
    ),
    "named type": (
        lambda f: (f.pop(f"{STAGE}/durations"), f.__setitem__(f"{STAGE}/durations", np.dtype("<f8"))),
        "durations is not a series of floats",
    ),
    "group within itself": (
        lambda f: f.__setitem__(f"{STAGE}/alternatives/1", f[STAGE]),
        "alternatives/1: '.*' is unknown",
    ),
    "too many objects": (lambda f: repeated_alternatives(f, 1000), "more than a checkpoint can"),
    "bytes counted twice": (repeated_bytes, "more than a checkpoint can"),
    "compressed": (
        lambda f: renew(f, f"{STAGE}/durations", data=np.zeros(2), compression="gzip"),
        "not stored plainly",
    ),
    "chunked": (lambda f: renew(f, f"{STAGE}/durations", data=np.zeros(2), chunks=(1,)), "not stored plainly"),
    "unallocated": (lambda f: renew(f, f"{STAGE}/durations", shape=(9,), dtype="<f8"), "not stored plainly"),
    "absurd size": (lambda f: renew(f, f"{STAGE}/durations", shape=(10**15,), dtype="<f8"), "more than a checkpoint"),
    "single precision": (
        lambda f: renew(f, f"{STAGE}/durations", data=np.zeros(2, "<f4")),
        "durations is not a series",
    ),
    "two dimensions": (lambda f: renew(f, f"{STAGE}/durations", data=np.zeros((1, 2))), "durations is not a series"),
    "no dataspace": (lambda f: renew(f, f"{STAGE}/durations", data=h5py.Empty("<f8")), "durations is not a series"),
    "variable-length text": (lambda f: renew(f, f"{STAGE}/message", data="hello"), "message is not a text"),
    "integers for floats": (lambda f: renew(f, f"{STAGE}/durations", data=np.zeros(2, "<i8")), "series of floats"),
    "floats for integers": (lambda f: renew(f, f"{STAGE}/first_node", data=np.zeros(3)), "series of integers"),
    "numbers for a text": (lambda f: renew(f, f"{STAGE}/message", data=np.zeros(2)), "message is not a text"),
    "a group for a series": (
        lambda f: (f.pop(f"{STAGE}/time"), f.create_group(f"{STAGE}/time")),
        "time is not a series",
    ),
    "missing member": (lambda f: f.pop(f"{STAGE}/durations"), "'durations' is missing"),
    "unknown member": (lambda f: f.create_group(f"{STAGE}/more"), "'more' is unknown"),
    "unknown stage": (lambda f: f.move(STAGE, "stages/warp"), "/stages: 'warp' is unknown"),
    "another schema": (lambda f: f.attrs.modify("schema", np.int64(2)), "schema is 2"),
    "an older schema": (
        lambda f: f.attrs.modify("schema", np.int64(6)),
        r"/inputs/settings/text .*`airrace optimize TRACK.yaml .*leave these and `margins\.…` out",
    ),
    "no schema": (lambda f: f.attrs.pop("schema"), "schema is None"),
    "no declaration": (lambda f: f[f"{STAGE}/states/V_K"].attrs.pop("upper"), "V_K: is not declared"),
    "the same row twice": (lambda f: f[f"{STAGE}/states/V_K"].attrs.modify("row", np.int64(0)), "are not 0, 1, 2"),
    "a row elsewhere": (lambda f: f[f"{STAGE}/states/V_K"].attrs.modify("row", np.int64(7)), "are not 0, 1, 2"),
    "a short history": (shorten_history, "V_K: 3 values instead of 7"),
    "phases out of order": (
        lambda f: renew(f, f"{STAGE}/first_node", data=np.array([0, 9, 6])),
        "first_node: does not divide",
    ),
    "too many durations": (lambda f: renew(f, f"{STAGE}/durations", data=np.zeros(3)), "3 durations of 2 phases"),
    "no nodes": (lambda f: renew(f, f"{STAGE}/time", data=np.zeros(0)), "interval_time"),
    "unknown outcome": (
        lambda f: renew(f, f"{STAGE}/outcome", data=np.array(b"fine", utf8(4))),
        "unknown outcome 'fine'",
    ),
    "other columns": (
        lambda f: renew(f, f"{STAGE}/splits", data=np.zeros(1, [("name", utf8(2)), ("time", "<f8")])),
        "splits is not a table of name, time, V_K, height",
    ),
    "a truth of two": (lambda f: f[f"{STAGE}/attempts"].__setitem__((0, "success"), 2), "neither 0 nor 1"),
    "no time for a phase": (lambda f: f[f"{STAGE}/durations"].__setitem__(0, 0.0), "a phase takes no time"),
    "an endless phase": (lambda f: f[f"{STAGE}/durations"].__setitem__(0, np.inf), "durations: holds numbers that"),
    "a state that is no number": (lambda f: f[f"{STAGE}/states/z"].__setitem__(3, np.nan), "states: holds numbers"),
    "an infinite control": (lambda f: f[f"{STAGE}/controls/sink"].__setitem__(2, -np.inf), "controls: holds numbers"),
    "a split that is no number": (
        lambda f: f[f"{STAGE}/splits"].__setitem__((0, "heading"), np.inf),
        "splits: holds numbers that are not finite",
    ),
    "a price that is no number": (
        lambda f: f[f"{STAGE}/constraint_multipliers"].__setitem__(1, np.nan),
        "constraint_multipliers: holds numbers",
    ),
    "a state that is too large": (
        lambda f: f[f"{STAGE}/states/z"].__setitem__(3, -1.1e30),
        "states: holds numbers larger than 1e",
    ),
    "a control that is too large": (
        lambda f: f[f"{STAGE}/controls/sink"].__setitem__(2, 1e200),
        "controls: holds numbers larger than 1e",
    ),
    "a quaternion that is no attitude": (
        lambda f: add_states(f, {"q0": 0.8, "q1": 0.0, "q2": 0.0, "q3": 0.0}),
        "states: the quaternion q0, q1, q2, q3 is not of length 1",
    ),
    "time that runs backwards": (lambda f: set_time(f, [0.0, 1.0, 0.5, 1.5, 2.0, 2.5, 3.0]), "run forwards from 0"),
    "time that begins later": (lambda f: set_time(f, np.linspace(0.5, 3.5, 7)), "run forwards from 0"),
    "time that runs fast": (lambda f: set_time(f, 0.995 * np.linspace(0.0, 3.0, 7)), "does not pass as the durations"),
    "a text that is not UTF-8": (
        lambda f: renew(f, f"{STAGE}/message", data=np.array(b"caf\xe9", utf8(4))),
        "message: a text is not UTF-8",
    ),
    "a course that is not UTF-8": (
        lambda f: renew(f, "inputs/track/text", data=np.array(b"name: caf\xe9", utf8(10))),
        "inputs/track/text: a text is not UTF-8",
    ),
    "an attribute that is not UTF-8": (
        lambda f: f[f"{STAGE}/states/V_K"].attrs.create("long_name", b"caf\xe9", dtype=utf8(4)),
        "V_K@long_name: a text is not UTF-8",
    ),
    "a row that is not UTF-8": (
        lambda f: renew(f, f"{STAGE}/phases", data=np.array([(b"caf\xe9",)] * 2, [("phase", utf8(4))])),
        "phases.phase: a text is not UTF-8",
    ),
    "a reason that does not exist": (lambda f: set_mesh(f, 6, 1), "mesh/why: holds reasons that do not exist"),
    "a reason that is too large": (lambda f: set_mesh(f, 257, 1), "mesh/why: holds numbers that are no int8"),
    "nodes of the coarser mesh twice": (lambda f: set_mesh(f, 1, 2), "mesh/coarser: holds numbers that are no bool"),
    "a mesh of another flight": (lambda f: set_mesh(f, 1, 1, 5), "mesh: does not belong to 6 intervals"),
    "a mesh with a gap": (
        lambda f: (set_mesh(f, 1, 1), renew(f, f"{STAGE}/mesh/drift", data=np.zeros(5))),
        "mesh: its series do not belong to the same intervals",
    ),
    "an unknown note": (
        lambda f: renew(f, f"{STAGE}/notes", data=np.array([(b"joke", b"ha")], [("kind", utf8(4)), ("text", utf8(2))])),
        "notes.kind: unknown kind 'joke'",
    ),
    "an outcome of no stage": (
        lambda f: renew(f, f"{STAGE}/outcome", data=np.array(b"certified", utf8(9))),
        "unknown outcome 'certified'",
    ),
    "two rows of timings": (
        lambda f: renew(f, f"{STAGE}/timings", data=np.repeat(f[f"{STAGE}/timings"][()], 2)),
        "2 rows instead of one",
    ),
}


def utf8(length: int) -> np.dtype:
    return h5py.string_dtype("utf-8", length)


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_checkpoint_with_a_valid_checksum_is_refused(sealed: bytes, tmp_path: Path, name: str) -> None:
    edit, words = FORGERIES[name]
    assert_refused(tmp_path / "run.h5", forged(sealed, tmp_path / "image.h5", edit), words)


def test_the_forger_s_tools_alone_change_nothing(sealed: bytes, tmp_path: Path) -> None:
    (tmp_path / "run.h5").write_bytes(forged(sealed, tmp_path / "image.h5", lambda file: None))
    assert_same(read_checkpoint(tmp_path / "run.h5").stages, example_checkpoint().stages)
