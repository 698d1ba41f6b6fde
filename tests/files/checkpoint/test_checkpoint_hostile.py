"""Damaged and tampered files: every one ends in a `CheckpointError`, none in another exception, a hang or a crash."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from checkpoint_examples import assert_same, contested, example_checkpoint

from airrace.errors import CheckpointError
from airrace.files.checkpoint import read_checkpoint, store, write_checkpoint
from airrace.files.checkpoint.store import BLOCK_SIZE, seal, unseal
from airrace.procedure.stage import Stage

STAGE = "stages/point-mass"
CHECKPOINT = example_checkpoint(Stage.HOMOTOPY).with_stage(contested())
Edit = Callable[[h5py.File], None]


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "run.h5"
    write_checkpoint(path, CHECKPOINT)
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


def tampered(sealed: bytes, path: Path, edit: Edit) -> bytes:
    """The checkpoint, edited and with its checksum computed anew."""
    path.write_bytes(unseal(sealed))
    with h5py.File(path, "r+") as file:
        edit(file)
    return seal(path.read_bytes())


def test_a_checkpoint_that_is_only_sealed_anew_is_read(sealed: bytes, tmp_path: Path) -> None:
    """The control case: what the tests below refuse, they refuse for their edits."""
    (tmp_path / "run.h5").write_bytes(tampered(sealed, tmp_path / "image.h5", lambda _: None))
    assert_same(read_checkpoint(tmp_path / "run.h5").stages, CHECKPOINT.stages)


def utf8(length: int) -> np.dtype:
    return h5py.string_dtype("utf-8", length)


def text(content: bytes) -> np.ndarray:
    return np.array(content, utf8(len(content)))


def drop(name: str) -> Edit:
    def edit(file: h5py.File) -> None:
        del file[f"{STAGE}/{name}"]

    return edit


def link(name: str, target: object) -> Edit:
    """A link, a named type or another object by this name."""

    def edit(file: h5py.File) -> None:
        drop(name)(file)
        file[f"{STAGE}/{name}"] = target

    return edit


def dataset(name: str, data: object = None, **storage: object) -> Edit:
    """Another dataset by this name; its attributes stay."""

    def edit(file: h5py.File) -> None:
        before = file[f"{STAGE}/{name}"]
        attributes = [(key, value, before.attrs.get_id(key).dtype) for key, value in before.attrs.items()]
        drop(name)(file)
        after = file.create_dataset(f"{STAGE}/{name}", data=data, **storage)
        for key, value, kind in attributes:
            if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):
                after.attrs.create(key, value, dtype=kind)

    return edit


def number(name: str, index: object, value: float) -> Edit:
    return lambda file: file[f"{STAGE}/{name}"].__setitem__(index, value)


def attribute(name: str, key: str, value: Any, dtype: np.dtype | None = None) -> Edit:
    return lambda file: file[name].attrs.create(key, value, dtype=dtype)


def group(name: str) -> Edit:
    return lambda file: file.create_group(f"{STAGE}/{name}")


def move(name: str, target: str) -> Edit:
    return lambda file: file.move(f"{STAGE}/{name}", f"{STAGE}/{target}")


def twice(name: str) -> Edit:
    """Every row of a table twice."""
    return lambda file: dataset(name, np.repeat(file[f"{STAGE}/{name}"][()], 2))(file)


def both(*edits: Edit) -> Edit:
    def edit(file: h5py.File) -> None:
        for step in edits:
            step(file)

    return edit


def virtual_dataset(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((2,), "<f8")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", (2,), "<f8")
    drop("durations")(file)
    file.create_virtual_dataset(f"{STAGE}/durations", layout)


def references(file: h5py.File) -> None:
    dataset("durations", np.array([file.ref, file.ref], h5py.ref_dtype))(file)


def repeated_alternatives(count: int) -> Edit:
    """A flight under many names."""

    def edit(file: h5py.File) -> None:
        flight = file.create_group("flight")
        for name in set(file[STAGE]) - {"alternatives", "inputs_hash", "chain_hash"}:
            flight[name] = file[STAGE][name]
        drop("alternatives")(file)
        for number in range(1, count + 1):
            file[f"{STAGE}/alternatives/{number}"] = flight
        del file["flight"]

    return edit


def course_not_utf8(file: h5py.File) -> None:
    del file["inputs/track/text"]
    file["inputs/track/text"] = text(b"caf\xe9")


def quaternion_of_length_0_8(file: h5py.File) -> None:
    speed = file[f"{STAGE}/states/V_K"]
    for row in range(4):
        name = f"{STAGE}/states/q{row}"
        file.copy(speed, name)
        file[name][:] = 0.0 if row else 0.8
        file[name].attrs["row"] = np.int64(2 + row)


def mesh(why: int, coarser: int, intervals: int = 6) -> Edit:
    return both(
        dataset("mesh/why", np.full(intervals, why)),
        dataset("mesh/coarser", np.full(intervals + 1, coarser)),
        dataset("mesh/defect", np.zeros(intervals)),
        dataset("mesh/drift", np.zeros(intervals)),
    )


def time(nodes: Sequence[float]) -> Edit:
    return both(number("time", ..., nodes), number("interval_time", ..., nodes[:-1]))  # type: ignore[arg-type]


SPEED = f"{STAGE}/states/V_K"
TAMPERED: dict[str, tuple[Edit, str]] = {
    # how HDF5 stores it
    "soft link": (link("durations", h5py.SoftLink("/stages/homotopy/durations")), "is a soft or external link"),
    "external link": (link("durations", h5py.ExternalLink("/etc/passwd", "/durations")), "is a soft or external link"),
    "external storage": (
        dataset("durations", shape=(2,), dtype="<f8", external=[("/etc/passwd", 0, 16)]),
        "not stored plainly",
    ),
    "virtual dataset": (virtual_dataset, "not stored plainly"),
    "compressed": (dataset("durations", np.zeros(2), compression="gzip"), "not stored plainly"),
    "chunked": (dataset("durations", np.zeros(2), chunks=(1,)), "not stored plainly"),
    "unallocated": (dataset("durations", shape=(9,), dtype="<f8"), "not stored plainly"),
    "absurd size": (dataset("durations", shape=(10**15,), dtype="<f8"), "more than a checkpoint"),
    "too many objects": (repeated_alternatives(1000), "more than a checkpoint can"),
    "bytes counted twice": (
        both(dataset("bound_multipliers", np.zeros(50_000)), repeated_alternatives(20)),
        "more than a checkpoint can",
    ),
    "group within itself": (
        lambda file: link("alternatives/1", file[STAGE])(file),
        "alternatives/1: '.*' is unknown",
    ),
    # kinds of values
    "object reference": (references, "durations is not a series of floats"),
    "reference as attribute": (lambda file: attribute(SPEED, "units", file.ref)(file), "V_K@units is not a short text"),
    "named type": (link("durations", np.dtype("<f8")), "durations is not a series of floats"),
    "single precision": (dataset("durations", np.zeros(2, "<f4")), "durations is not a series"),
    "two dimensions": (dataset("durations", np.zeros((1, 2))), "durations is not a series"),
    "no dataspace": (dataset("durations", h5py.Empty("<f8")), "durations is not a series"),
    "integers for floats": (dataset("durations", np.zeros(2, "<i8")), "series of floats"),
    "floats for integers": (dataset("first_node", np.zeros(3)), "series of integers"),
    "variable-length text": (dataset("message", "hello"), "message is not a text"),
    "numbers for a text": (dataset("message", np.zeros(2)), "message is not a text"),
    "group for a series": (both(drop("time"), group("time")), "time is not a series"),
    "series for a group": (link("alternatives/1", np.zeros(3)), "1 is not a group"),
    "text not UTF-8": (dataset("message", text(b"caf\xe9")), "message: a text is not UTF-8"),
    "course not UTF-8": (course_not_utf8, "inputs/track/text: a text is not UTF-8"),
    "attribute not UTF-8": (
        attribute(SPEED, "long_name", b"caf\xe9", utf8(4)),
        "V_K@long_name: a text is not UTF-8",
    ),
    "row not UTF-8": (
        dataset("phases", np.array([(b"caf\xe9",)] * 2, [("phase", utf8(4))])),
        "phases.phase: a text is not UTF-8",
    ),
    "other columns": (
        dataset("splits", np.zeros(1, [("name", utf8(2)), ("time", "<f8")])),
        "splits is not a table of name, time, V_K, height",
    ),
    "flag of two": (number("attempts", (0, "success"), 2), "neither 0 nor 1"),
    # members
    "missing member": (drop("durations"), "'durations' is missing"),
    "unknown member": (group("more"), "'more' is unknown"),
    "unknown stage": (lambda file: file.move(STAGE, "stages/warp"), "/stages: 'warp' is unknown"),
    "another schema": (attribute("/", "schema", np.int64(2)), "schema is 2"),
    "older schema": (
        attribute("/", "schema", np.int64(6)),
        r"/inputs/settings/text .*`airrace optimize TRACK.yaml .*leave these and `margins\.…` out",
    ),
    "no schema": (lambda file: file.attrs.pop("schema"), "schema is None"),
    "no declaration": (lambda file: file[SPEED].attrs.pop("upper"), "V_K: is not declared"),
    "same row twice": (attribute(SPEED, "row", np.int64(0)), "are not 0, 1, 2"),
    "row out of range": (attribute(SPEED, "row", np.int64(7)), "are not 0, 1, 2"),
    "unknown outcome": (dataset("outcome", text(b"certified")), "unknown outcome 'certified'"),
    "unknown note": (
        dataset("notes", np.array([(b"joke", b"ha")], [("kind", utf8(4)), ("text", utf8(2))])),
        "notes.kind: unknown kind 'joke'",
    ),
    "two rows of timings": (twice("timings"), "2 rows instead of one"),
    # sizes and numbers that contradict each other
    "short history": (dataset("states/V_K", np.zeros(3)), "V_K: 3 values instead of 7"),
    "phases out of order": (dataset("first_node", np.array([0, 9, 6])), "first_node: does not divide"),
    "too many durations": (dataset("durations", np.zeros(3)), "3 durations of 2 phases"),
    "no nodes": (dataset("time", np.zeros(0)), "interval_time"),
    "phase of no duration": (number("durations", 0, 0.0), "a phase takes no time"),
    "endless phase": (number("durations", 0, np.inf), "durations: holds numbers that"),
    "state not a number": (number("states/z", 3, np.nan), "states: holds numbers"),
    "infinite control": (number("controls/sink", 2, -np.inf), "controls: holds numbers"),
    "infinite split": (number("splits", (0, "heading"), np.inf), "splits: holds numbers that are not finite"),
    "multiplier not a number": (number("constraint_multipliers", 1, np.nan), "constraint_multipliers: holds numbers"),
    "state out of range": (number("states/z", 3, -1.1e30), "states: holds numbers larger than 1e"),
    "quaternion of another length": (quaternion_of_length_0_8, "q0, q1, q2, q3 is not of length 1"),
    "time that runs backwards": (time([0.0, 1.0, 0.5, 1.5, 2.0, 2.5, 3.0]), "run forwards from 0"),
    "time that begins later": (time(np.linspace(0.5, 3.5, 7).tolist()), "run forwards from 0"),
    "time that runs fast": (time(np.linspace(0.0, 2.985, 7).tolist()), "does not pass as the durations"),
    "unknown reason": (mesh(6, 1), "mesh/why: holds reasons that do not exist"),
    "reason out of range": (mesh(257, 1), "mesh/why: holds numbers that are no int8"),
    "node of the coarser mesh twice": (mesh(1, 2), "mesh/coarser: holds numbers that are no bool"),
    "mesh of another flight": (mesh(1, 1, 5), "mesh: does not belong to 6 intervals"),
    "mesh with a gap": (
        both(mesh(1, 1), dataset("mesh/drift", np.zeros(5))),
        "mesh: its series do not belong to the same intervals",
    ),
    # routes and alternatives
    "unknown member of the search": (group("search/more"), "'more' is unknown"),
    "no routes": (drop("search/routes"), "'routes' is missing"),
    "no summary": (drop("search/summary"), "'summary' is missing"),
    "two summaries": (twice("search/summary"), "summary: 2 rows instead of one"),
    "loops of numbers": (dataset("search/loops", np.zeros(2)), "loops"),
    "routes of other columns": (
        dataset("search/routes", np.zeros(1, [("text", "S2"), ("race_time", "<f8")])),
        "routes",
    ),
    "no search": (drop("search"), "'search' is missing"),
    "no group of alternatives": (drop("alternatives"), "'alternatives' is missing"),
    "gap between alternatives": (move("alternatives/1", "alternatives/3"), "'3' is unknown|'1' is missing"),
    "alternative 0": (move("alternatives/1", "alternatives/0"), "'0' is unknown|'1' is missing"),
    "alternative with a name": (move("alternatives/2", "alternatives/best"), "'best' is unknown|'2' is missing"),
    "alternative with alternatives": (group("alternatives/1/alternatives"), "'alternatives' is unknown"),
    "alternative with hashes": (
        lambda file: file.copy(f"{STAGE}/inputs_hash", f"{STAGE}/alternatives/1/inputs_hash"),
        "'inputs_hash' is unknown",
    ),
    "alternative without a flight": (drop("alternatives/1/states"), "'states' is missing"),
    "alternative with an unknown outcome": (
        dataset("alternatives/1/outcome", text(b"fine")),
        "unknown outcome 'fine'",
    ),
}


@pytest.mark.parametrize("name", TAMPERED)
def test_a_tampered_checkpoint_with_a_valid_checksum_is_refused(sealed: bytes, tmp_path: Path, name: str) -> None:
    edit, words = TAMPERED[name]
    assert_refused(tmp_path / "run.h5", tampered(sealed, tmp_path / "image.h5", edit), words)
