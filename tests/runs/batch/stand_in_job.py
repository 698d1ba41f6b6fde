"""Stands in for the process of a job: tells and writes what a real one would, and flies nothing.

How it behaves the course's `notes` say, given by `--set notes=...` or swept; see `main`. Every start adds a line to a
file `NAME.starts` beside the checkpoint.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

CHECKPOINT = b"a finished stage"


def behaviour(job: dict) -> str:
    """The last `notes` that were set; `fine` without any."""
    notes = [text.partition("=")[2] for text in job["overrides"] if text.startswith("notes=")]
    return notes[-1] if notes else "fine"


def stage(race_time: float | None, status: str = "solved") -> dict:
    """A stage as `airrace optimize --json` prints it."""
    items = [
        {"name": "kkt_error", "value": 1e-9, "limit": 1e-6, "unit": "", "holds": True, "where": ""},
        {
            "name": "path_angle",
            "value": 0.01 if status == "not certified" else 1e-3,
            "limit": 0.0035,
            "unit": "rad",
            "holds": status != "not certified",
            "where": "1:start -> 1:g1",
        },
    ]
    return {
        "stage": "point-mass",
        "status": status,
        "message": "" if status == "solved" else f"the course is {status}",
        "race_time_s": race_time,
        "regularisation_s": 0.001,
        "started_from": None,
        "tracking_error_m": None,
        "iterations": 12,
        "solve_s": 0.5,
        "derivatives_s": 0.4,
        "wall_s": 0.75,
        "certified": status == "solved",
        "certificate": {"solver_status": "solved", "items": items} if race_time is not None else None,
    }


def run_object(job: dict, race_time: float | None, status: str = "solved") -> dict:
    """The object of `airrace optimize --json`."""
    return {
        "track": job["course"],
        "certified": status == "solved",
        "race_time_s": race_time,
        "wall_s": 0.8,
        "stages": [stage(race_time, status)],
    }


def race_time_of(job: dict) -> float:
    """10 s, and 0.1 s for each knot of wind that was set."""
    knots = [text.partition("=")[2] for text in job["overrides"] if text.startswith("environment.wind.speed_kt=")]
    return 10.0 + 0.1 * float(knots[-1] if knots else 0.0)


def main() -> None:
    with contextlib.suppress(ImportError):  # a system that leaves no core behind has no such module
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    order = json.loads(sys.stdin.readline())
    job, path = order["job"], Path(order["checkpoint"])
    replies = sys.stdout

    def tell(line: dict) -> None:
        print(json.dumps(line), file=replies, flush=True)

    def end(code: int, run: dict, error: str = "") -> None:
        tell({"ended": {"code": code, "run": run, "error": error, "findings": []}})

    resumed = path.exists()
    with path.with_suffix(".starts").open("a") as starts:
        starts.write(f"{os.getpid()} {'resumed' if resumed else 'new'}\n")
    if behaviour(job).endswith("-once") and not resumed:
        path.write_bytes(CHECKPOINT)
    tell({"stage_started": "point-mass"})
    race_time = race_time_of(job)
    match behaviour(job):
        case "infeasible":
            path.write_bytes(CHECKPOINT)
            end(4, run_object(job, None, "infeasible"), "point-mass: the course is infeasible")
            return
        case "not-certified":
            path.write_bytes(CHECKPOINT)
            end(5, run_object(job, race_time, "not certified"), "point-mass: not certified: path_angle")
            return
        case "crash":
            os.abort()
        case "crash-once" if not resumed:
            os.abort()
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "exit":
            sys.stderr.write("the last words\n")
            sys.exit(3)
        case "hang":
            time.sleep(600.0)
        case "hang-once" if not resumed:
            time.sleep(600.0)
        case "deaf":  # to being told to stop, with a process of its own
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            sleeper = subprocess.Popen(["sleep", "600"], start_new_session=True)
            path.with_suffix(".child").write_text(str(sleeper.pid))
            time.sleep(600.0)
        case "astray":
            replies.write(
                'nonsense\n{"stage_finished": 7}\n[]\n{"ended": {"code": "x"}}\n{"ended": {"code": 0, "run": NaN}}\n'
            )
            replies.flush()
            return
        case "slow":
            time.sleep(0.3)
        case "no-checkpoint":
            end(0, run_object(job, race_time))
            return
        case _:
            pass
    path.write_bytes(CHECKPOINT)
    tell({"stage_finished": "point-mass", "status": "solved", "race_time_s": race_time, "certified": True})
    end(0, run_object(job, race_time))


if __name__ == "__main__":
    main()
