"""The texts that `airrace show` prints of a run."""

import textwrap
from collections.abc import Iterator

from airrace.cli.clearance_tables import near_misses_text
from airrace.cli.leg_tables import laps_line, leg_tables
from airrace.cli.mesh_table import mesh_table
from airrace.cli.stored_stages import Shown
from airrace.cli.tables import PAGE, certificate_line, rendered, result_tables, stages_table
from airrace.procedure.result import UNVERIFIABLE, StageResult

UNVERIFIED = "\n".join(
    textwrap.wrap(
        "unverified: all of this is read from the file, and nothing was measured again. `airrace verify` does that. "
        f"Nobody can verify {', '.join(UNVERIFIABLE[:-1])} and {UNVERIFIABLE[-1]}.",
        PAGE,
    )
)
"""The sentences that `airrace show` says of its numbers."""


def shown_texts(shown: Shown, *, legs: bool, certificates: bool) -> Iterator[str]:
    """Yield the stages, what each of them says, then splits, ways, legs and certificates; at most 80 columns wide.

    Args:
        shown: what is told.
        legs: whether every leg of the chosen flight is told.
        certificates: whether the items of the certificates are listed instead of told in a line.
    """
    results = shown.results
    yield rendered(stages_table(results), columns=PAGE) if results else "no stage is finished yet"
    if results:
        yield UNVERIFIED
    yield from (f"{result.stage.value}: {result.remarks}" for result in results if result.remarks)
    yield from (f"a needless loop: {loop}" for result in results for loop in result.search.loops)
    for result in results:
        yield from _stage_texts(result, certificates=certificates)
        if result.stage.value == shown.stage:
            yield from _flight_texts(shown, legs=legs)


def _stage_texts(result: StageResult, *, certificates: bool) -> Iterator[str]:
    meshes = [mesh_table(result)] if len(result.mesh.why) else []
    for table in (*result_tables(result, certificate=certificates), *meshes):
        yield rendered(table, columns=PAGE)
    if result.certificate is not None and not certificates:
        yield certificate_line(result)


def _flight_texts(shown: Shown, *, legs: bool) -> Iterator[str]:
    assert shown.flight is not None  # its stage is known
    if line := laps_line(shown.flight):
        yield line
    if misses := near_misses_text(shown.flight):
        yield misses
    if legs:
        yield from (rendered(table, columns=PAGE) for table in leg_tables(shown.flight))
