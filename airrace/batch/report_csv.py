"""`--csv`: a row per job, in the order of the ranking. Opens in any spreadsheet."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from airrace.batch.ranking import Row
from airrace.batch.record import checkpoint_path

COLUMNS = ("name", "course", "track", "aircraft")
MEASURED = ("state", "code", "stage", "race_time_s", "behind_s", "laps_s", "wall_s", "kept", "retries", "message")
WAYS = ("way", "ways_tried", "next_way", "next_way_behind_s")


def csv_text(rows: Sequence[Row], folder: Path) -> str:
    """The table as RFC 4180, a column for every swept key; numbers at full precision, nothing where there is none."""
    keys = list(dict.fromkeys(key for row in rows for key, _ in row.step.swept))
    written = io.StringIO()
    writer = csv.writer(written)
    writer.writerow([*COLUMNS, *keys, *MEASURED, *WAYS, "checkpoint"])
    for row in rows:
        step, result, swept, ways = row.step, row.result, dict(row.step.swept), row.result.ways
        writer.writerow(
            [
                *(step.name, step.course, step.track, step.aircraft),
                *(swept.get(key) for key in keys),
                *(row.state, result.code, result.stage, result.race_time, row.behind),
                *(" ".join(str(lap) for lap in result.laps), result.wall),
                "yes" if step.action == "keep" else "no",
                len(result.retries),
                result.message,
                *((None,) * len(WAYS) if ways is None else (ways.flown, ways.tried, ways.next, ways.behind)),
                checkpoint_path(folder, step.name) if step.action != "refuse" else None,
            ]
        )
    return written.getvalue()
