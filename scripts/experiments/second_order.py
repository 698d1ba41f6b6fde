"""Curvature of stored optima: which stages are minima, which have directions that cost nothing, and which are saddles.

    python scripts/experiments/second_order.py RUN.h5 ...

One line per stage of each run, as a row of a table in Markdown.
"""

import sys
import time
from pathlib import Path

import airrace


def main(paths: list[str]) -> None:
    print("| course | stage | intervals | curvature | least, s | in | active limits | weakly | processor s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for path in paths:
        run = airrace.open(path)
        for stage in run.stages:
            if stage.certificate is None:
                continue
            began = time.process_time()
            found = stage.second_order()
            seconds = time.process_time() - began
            cells = (
                *(f"`{Path(path).stem}`", f"`{stage.name}`", len(stage.trajectory.time) - 1, found.curvature.value),
                *(f"{found.least:.1e}", found.where or "nowhere", found.active, found.weakly_active, f"{seconds:.2f}"),
            )
            print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
