"""The contents of a checkpoint, and which of its stages can still be trusted.

Every stage carries a link of a hash chain. With `h_0` the empty string,

    h_i = sha256(h_(i-1) | inputs hash | stage name | digest of the result)

so a stage stands only on the inputs and on the very stages it was computed from. One whose mesh check is completed
later takes the place of the one that was solved, and the links above it are made anew: it is the same optimum, on a
finer mesh.
"""

import dataclasses
import hashlib
import struct
from collections.abc import Iterator, Mapping
from dataclasses import replace
from enum import Enum
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from airrace.procedure.result import StageResult
from airrace.procedure.stage import STAGES, Stage


@dataclasses.dataclass(frozen=True)
class StoredDocument:
    """A YAML input: the path it was read from and its text, unchanged."""

    path: str
    text: str


@dataclasses.dataclass(frozen=True)
class StoredInputs:
    """The inputs of a run, as documents and as resolved.

    Attributes:
        track, aircraft: the documents.
        settings: None where the defaults were used.
        overrides: `key=value` entries of the command line, in their order.
        resolved: JSON text of the configuration as understood. Its hash decides whether stages are stale, so equal
            configurations must give equal texts (sorted keys).
    """

    track: StoredDocument
    aircraft: StoredDocument
    settings: StoredDocument | None
    overrides: tuple[str, ...]
    resolved: str


@dataclasses.dataclass(frozen=True)
class StoredStage:
    """A finished stage, the hash of the inputs it was computed from and its link of the chain (both hex)."""

    result: StageResult
    inputs_hash: str
    chain_hash: str


@dataclasses.dataclass(frozen=True)
class ReserveAttempt:
    """A finished attempt of the search for a reserve: what was measured, and with what the next one begins.

    Attributes:
        asked: JSON text of the requested reserve.
        flights: number of closed-loop flights; 0 where there is no flight with such margins.
        broken: the flights that break a limit.
        outside: the flights that break a limit other than the load factor.
        over_g: the flights with a pull that counts.
        risk: to be allocated to all limits.
        load_weight: by how much more often pulls count than the linear covariance predicts, beside other limits.
        lift: the share of the full margin of the lift coefficient.
        done: whether no attempt follows.
    """

    asked: str
    flights: int
    broken: int
    outside: int
    over_g: int
    risk: float
    load_weight: float
    lift: float
    done: bool


@dataclasses.dataclass(frozen=True)
class StoredAttempt:
    """An attempt with the flight that it was measured along.

    Attributes:
        attempt: what was measured.
        overrides: `key=value` entries of the inputs of that flight, margins included.
        result: the flight; None where there is none with such margins.
        chain_hash: link of the chain (hex), which goes on from that of the last stage.
    """

    attempt: ReserveAttempt
    overrides: tuple[str, ...]
    result: StageResult | None
    chain_hash: str


@dataclasses.dataclass(frozen=True)
class Checkpoint:
    """A run as it is stored: its inputs and its finished stages.

    Attributes:
        inputs: of the run.
        versions: the versions of airrace and of what its numbers depend on (casadi, numpy, python), by name.
        stages: finished stages in the order of `Stage`, each at most once.
        attempts: finished attempts of a search for a reserve that has not ended, in their order.
    """

    inputs: StoredInputs
    versions: Mapping[str, str]
    stages: tuple[StoredStage, ...] = ()
    attempts: tuple[StoredAttempt, ...] = ()

    def with_stage(self, result: StageResult) -> Self:
        """Return this run with one more finished stage.

        Stages from this one on are dropped, and attempts of a reserve: they were computed from what `result` now
        replaces.
        """
        position = STAGES.index(result.stage)
        earlier = tuple(stored for stored in self.stages if STAGES.index(stored.result.stage) < position)
        inputs = inputs_hash(self.inputs.resolved)
        link = chain_hash(earlier[-1].chain_hash if earlier else "", inputs, result)
        return replace(self, stages=(*earlier, StoredStage(result, inputs, link)), attempts=())

    def with_attempt(self, attempt: ReserveAttempt, overrides: tuple[str, ...], result: StageResult | None) -> Self:
        """Return this run with one more attempt of the search for its reserve; arguments as of `StoredAttempt`."""
        standing = self.standing_attempts(attempt.asked)
        before = standing[-1].chain_hash if standing else self.stages[-1].chain_hash
        link = attempt_hash(before, attempt, overrides, result)
        return replace(self, attempts=(*standing, StoredAttempt(attempt, overrides, result, link)))

    def standing_attempts(self, asked: str) -> tuple[StoredAttempt, ...]:
        """Return the attempts that were made from the last stage as it is now, for the requested reserve."""
        standing: list[StoredAttempt] = []
        before = self.stages[-1].chain_hash if self.stages else ""
        for stored in self.attempts:
            link = attempt_hash(before, stored.attempt, stored.overrides, stored.result)
            if stored.attempt.asked != asked or stored.chain_hash != link:
                break
            standing.append(stored)
            before = link
        return tuple(standing)

    def with_mesh_check(self, result: StageResult) -> Self:
        """Return this run with a stage whose mesh check was completed or tried, in place of the one that was solved.

        Later stages stay, and those that stood on the one before stand on this one; attempts of a reserve do not.
        """
        broken = {stage for stage, _ in stale_stages(self, inputs_hash(self.inputs.resolved))}
        stages: list[StoredStage] = []
        for stored in self.stages:
            if STAGES.index(stored.result.stage) >= STAGES.index(result.stage) and stored.result.stage not in broken:
                replacement = result if stored.result.stage is result.stage else stored.result
                link = chain_hash(stages[-1].chain_hash if stages else "", stored.inputs_hash, replacement)
                stages.append(replace(stored, result=replacement, chain_hash=link))
            else:
                stages.append(stored)
        return replace(self, stages=tuple(stages), attempts=())

    def stage(self, stage: Stage) -> StoredStage | None:
        """Return the stored stage, or None if it has not been finished."""
        return next((stored for stored in self.stages if stored.result.stage is stage), None)


def inputs_hash(resolved_json: str) -> str:
    """Return the sha256 (hex) of the resolved configuration."""
    return hashlib.sha256(resolved_json.encode("utf-8", "surrogateescape")).hexdigest()


def chain_hash(previous: str, inputs: str, result: StageResult) -> str:
    """Return the next link of the chain (hex); `previous` is empty for the first stage."""
    text = "\n".join((previous, inputs, result.stage.value, content_digest(result)))
    return hashlib.sha256(text.encode()).hexdigest()


def attempt_hash(previous: str, attempt: ReserveAttempt, overrides: tuple[str, ...], result: StageResult | None) -> str:
    """Return the next link of the chain for an attempt (hex); `previous` is that of the last stage or attempt."""
    digests = (content_digest(part) for part in (attempt, overrides, result))
    return hashlib.sha256("\n".join((previous, *digests)).encode()).hexdigest()


def stale_stages(checkpoint: Checkpoint, current_inputs_hash: str) -> list[tuple[Stage, str]]:
    """Return the stages that have to be computed again, in order, each with the reason (a clause for the user)."""
    stale: list[tuple[Stage, str]] = []
    previous = ""
    for stored in checkpoint.stages:
        reason = ""
        if stored.inputs_hash != current_inputs_hash:
            reason = "the resolved configuration changed since it was computed"
        elif stored.chain_hash != chain_hash(previous, stored.inputs_hash, stored.result):
            reason = "its record, or a stage before it, changed since it was computed"
        elif stale:
            reason = f"a stage before it changed ({stale[-1][0].value})"
        if reason:
            stale.append((stored.result.stage, reason))
        previous = stored.chain_hash
    return stale


def content_digest(value: object) -> str:
    """Return the sha256 (hex) of a frozen dataclass, or of what its fields may be.

    These are arrays, strings, numbers, enums, tuples and further such dataclasses.

    Numbers count as what they are stored as, 64-bit floats and integers: 1 and 1.0 have the same digest, as they are
    the same after a round trip; 0.0 and -0.0 have not. A field whose metadata say `"counts": "where set"` is left out
    while it is empty, so that a record that was stored before the field existed keeps its digest.

    Raises:
        TypeError: for a value of another kind.
    """
    digest = hashlib.sha256()
    for piece in _pieces(value):
        # Each piece is preceded by its length, so that ("ab", "c") and ("a", "bc") are distinguished.
        digest.update(struct.pack("<Q", len(piece)))
        digest.update(piece)
    return digest.hexdigest()


def _pieces(value: object) -> Iterator[bytes]:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield type(value).__name__.encode()
        for field in dataclasses.fields(value):
            entry = getattr(value, field.name)
            if field.metadata.get("counts") == "where set" and not entry:
                continue
            yield field.name.encode()
            yield from _pieces(entry)
    elif isinstance(value, tuple):
        members: tuple[object, ...] = value  # pyright: ignore[reportUnknownVariableType]  # narrowed from object
        yield struct.pack("<Q", len(members))
        for member in members:
            yield from _pieces(member)
    elif isinstance(value, np.ndarray):
        array = cast(NDArray[Any], value)  # Any: floats or integers
        number = "<f8" if array.dtype.kind == "f" else "<i8"
        yield f"{number}{array.shape}".encode()
        yield array.astype(number).tobytes()
    else:
        yield _scalar(value)


def _scalar(value: object) -> bytes:
    match value:
        case None:
            return b"none"
        case Enum() | Stage():
            return f"enum {value.value}".encode()
        case bool() | np.bool_():
            return b"true" if value else b"false"
        case int() | float() | np.integer() | np.floating():
            return b"number" + struct.pack("<d", float(value))  # pyright: ignore[reportUnknownArgumentType]  # numpy's width
        case str():
            return b"text" + value.encode("utf-8", "surrogateescape")
        case _:
            raise TypeError(f"no digest is defined for {type(value).__name__}")
