"""Curvature of stored optima: which stages are minima, which have directions that cost nothing, and which are saddles.

    python scripts/experiments/second_order.py RUN.h5 ...

One line per stage of each run, as a row of a table in Markdown.
"""

import sys
from pathlib import Path

import airrace


def main(paths: list[str]) -> None:
    print("| course | stage | intervals | curvature | least, s | threshold, s | in | active limits | weakly |")
    print("|---|---|---|---|---|---|---|---|---|")
    for path in paths:
        run = airrace.open(path)
        for stage in run.stages:
            found = None if stage.certificate is None else stage.certificate.second_order
            if found is None:
                continue
            cells = (
                *(f"`{Path(path).stem}`", f"`{stage.name}`", len(stage.trajectory.time) - 1, found.curvature.value),
                *(f"{found.least:.1e}", f"{found.threshold:.1e}", found.where or "nowhere", found.active),
                found.weakly_active,
            )
            print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
