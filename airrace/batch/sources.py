"""The courses that a user means with files, patterns and `batch.yaml`, and the settings of each."""

import glob
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from itertools import islice
from pathlib import Path

from airrace.batch.jobs import Sweep, parse_sweep, sweep_of
from airrace.errors import Finding, InputError
from airrace.inputs.batch import BatchEntry, is_batch, read_batch, set_texts, value_text
from airrace.inputs.document import AIRCRAFT, TRACKS, Document, read_document
from airrace.inputs.nodes import MappingNode, Place, Reporter
from airrace.records import record
from airrace.standard_streams import STANDARD, name_of

FOLDERS_MAX = 10_000
"""The largest number of folders that one pattern is looked for in; a tenth of a second's work on most disks."""
MATCHES_MAX = 20_000
"""The largest number of files that one pattern may mean; each of them is read before any job runs."""


class TooWideError(Exception):
    """An error of a pattern that would be looked for in too many places, in words."""


def matching(pattern: str) -> list[str]:
    """Return the files that match a pattern, sorted by name.

    Raises:
        TooWideError: too many folders or files would have to be looked at.
    """
    found = list(islice((name for name in _expand(pattern) if not os.path.isdir(name)), MATCHES_MAX + 1))
    if len(found) > MATCHES_MAX:
        raise TooWideError(f"matches more than {MATCHES_MAX} files; name fewer of them")
    return sorted(found)


def _expand(pattern: str) -> Iterator[str]:
    parts = Path(pattern).parts
    if "**" not in parts:
        yield from glob.iglob(pattern)
        return
    place = parts.index("**")
    above, below = parts[:place], parts[place + 1 :]
    names = below or ("*",)
    for folder in _folders(os.path.join(*above) if above else ""):
        yield from _expand(os.path.join(glob.escape(folder), *names))


def _folders(pattern: str) -> Iterator[str]:
    """Yield the folders that match and all within them, but for hidden ones and those that only links lead to."""
    looked_at = 0
    for top in glob.iglob(pattern) if pattern else [""]:
        for folder, within, _ in os.walk(top or os.curdir, followlinks=False):
            looked_at += 1
            if looked_at > FOLDERS_MAX:
                raise TooWideError(f"leads through more than {FOLDERS_MAX} folders; name one further down")
            within[:] = sorted(name for name in within if not name.startswith("."))
            yield folder if top else os.path.relpath(folder).removeprefix(os.curdir)


SWEEP_OPTION = "--sweep"


@record
class Manner:
    """The settings with which courses are solved.

    Attributes:
        aircraft: files, each of which flies every course; empty for the tracks' own.
        settings: a settings file, None for the defaults.
        overrides: `key=value` texts for all jobs.
        sweeps: values tried in turn.
        until: name of the last stage, None where nobody names one.
        places: where keys are set or swept in a file, for what is found to be wrong with them.
    """

    aircraft: tuple[Path, ...] = ()
    settings: Path | None = None
    overrides: tuple[str, ...] = ()
    sweeps: tuple[Sweep, ...] = ()
    until: str | None = None
    places: Mapping[str, Place] = field(default_factory=dict[str, Place])


@record
class SourceGroup:
    """A group of courses with the same settings."""

    courses: tuple[Path, ...]
    manner: Manner


@record
class Sources:
    """The groups of courses that were meant, what is wrong with the way they were named, and the batch files."""

    groups: tuple[SourceGroup, ...]
    findings: tuple[Finding, ...] = ()
    files: tuple[Path, ...] = ()


def parse_sweeps(texts: Sequence[str]) -> tuple[Sweep, ...]:
    """Return the sweeps of the command line.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    findings: list[Finding] = []
    sweeps: dict[str, Sweep] = {}
    for text in texts:
        key = text.partition("=")[0].strip()
        try:
            sweep = parse_sweep(text)
        except ValueError as error:
            findings.append(Finding(SWEEP_OPTION, 0, 0, key, str(error)))
            continue
        if sweep.key in sweeps:
            findings.append(Finding(SWEEP_OPTION, 0, 0, key, "is swept twice; give all its values at once"))
        sweeps[sweep.key] = sweep
    if findings:
        raise InputError(findings)
    return tuple(sweeps.values())


def find_sources(named: Sequence[str], manner: Manner) -> Sources:
    """Return the courses named by files and patterns, and those of batch files.

    The manner of the command line comes first: it replaces the aircraft, the settings, the last stage and the sweeps of
    the same key in batch files, and its overrides come after theirs.
    """
    findings: list[Finding] = []
    courses: list[Path] = []
    groups: list[SourceGroup] = []
    files: list[Path] = []
    for path in _files(named, Path(), None, findings):
        document = _batch_document(path)
        if document is None and path == STANDARD:
            findings.append(Finding(name_of(path), 0, 0, "", "is no batch file, and courses are named"))
            continue
        if document is None:
            courses.append(path)
            continue
        files.append(path)
        try:
            entry, reporter = read_batch(document)
            groups.append(_group_of(entry, reporter, path.parent, manner))
            findings += reporter.findings
        except InputError as error:
            findings += error.findings
    if courses:
        groups.insert(0, SourceGroup(tuple(courses), manner))
    return Sources(tuple(groups), tuple(findings), tuple(files))


def _batch_document(path: Path) -> Document | None:
    """Return the file at a path if it is a batch, else None.

    Whatever else is wrong with the file is reported when it is read as a course.
    """
    document = read_document(path, []) if path == STANDARD or os.path.isfile(path) else None
    return document if document is not None and is_batch(document) else None


def _group_of(entry: BatchEntry, reporter: Reporter, folder: Path, manner: Manner) -> SourceGroup:
    findings: list[Finding] = []
    courses: list[Path] = []
    for path in list(_files(entry.courses, folder, reporter, findings)):
        if _batch_document(path) is None:
            courses.append(path)
        else:
            reporter.value(("courses",), f"{path} is a batch and no course; name the courses that it names")
    reporter.findings.extend(findings)
    sweeps: dict[str, Sweep] = {}
    for key, values in entry.sweep.items():
        items = values.split(",") if isinstance(values, str) else [value_text(value) for value in values]
        try:
            sweeps[key] = sweep_of(key, items)
        except ValueError as error:
            reporter.value(("sweep", key), str(error))
    of_command_line = {sweep.key: sweep for sweep in manner.sweeps}
    places: dict[str, Place] = {}
    for part in ("set", "sweep"):
        node = reporter.find((part,))
        if isinstance(node, MappingNode):
            places |= {key: one.key_place for key, one in node.entries.items() if key not in of_command_line}
    return SourceGroup(
        tuple(courses),
        Manner(
            aircraft=manner.aircraft or tuple(AIRCRAFT.meant(Path(name), folder) for name in entry.aircraft or ()),
            settings=manner.settings or (None if entry.settings is None else folder / entry.settings),
            overrides=(*set_texts(entry.set), *manner.overrides),
            sweeps=tuple({**sweeps, **of_command_line}.values()),
            until=manner.until or entry.until,
            places=places,
        ),
    )


def _files(named: Sequence[str], folder: Path, reporter: Reporter | None, findings: list[Finding]) -> Iterator[Path]:
    """Yield the files of names and patterns, in their order; those of a pattern by name.

    What is wrong with a name is reported where a batch file has it, else among the findings.
    """
    for index, name in enumerate(named):
        path, file = folder / name, Path(name)
        if not glob.has_magic(name) or path.exists():
            if path.is_dir():
                findings.append(Finding(str(path), 0, 0, "", f"is a folder; name the files in it, e.g. {path}/*.yaml"))
            elif TRACKS.finds(file, folder):
                yield TRACKS.meant(file, folder)
            elif reporter is not None and not path.exists():
                reporter.value(("courses", index), TRACKS.missing(file, folder))
            else:  # a missing course becomes a job with invalid input
                yield path
            continue
        try:
            matches = matching(str(path))
            of_batch, alone = ("", "") if matches else (f"no file matches {path}", "no file matches this pattern")
        except TooWideError as error:
            matches, of_batch, alone = [], f"{path} {error}", str(error)
        yield from map(Path, matches)
        if alone and reporter is not None:
            reporter.value(("courses", index), of_batch)
        elif alone:
            findings.append(Finding(str(path), 0, 0, "", alone))
