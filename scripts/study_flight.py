"""One job of a study in a process of its own: reads the job, prints its record as JSON. Started by `study_jobs.py`."""

import json
import math
import signal
import sys
import time

from airrace.optimal_control.solvers.process.idle_processes import start_early

if __name__ == "__main__":
    start_early()  # the solver process loads while all else does

from study_draws import refined, solved_roughly
from study_jobs import CERTIFIED, Job, Record, inputs_of
from transformations import mirrored, moved, rotated

from airrace.errors import AirraceError, InputError
from airrace.planning.race import Race
from airrace.procedure.progress import Silent
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.run import optimize
from airrace.runs.json_objects import stage_object

TURN = math.radians(37.0)
NORTH, EAST = 1234.0, -567.0  # m


def changed(race: Race, change: str) -> Race:
    """The race, transformed as a job asks for."""
    match change:
        case "mirrored":
            return mirrored(race)
        case "rotated":
            return rotated(race, TURN)
        case "moved":
            return moved(race, NORTH, EAST)
        case _:
            return race


def record_of(result: StageResult) -> Record:
    """What is kept of a finished stage, as far as `airrace optimize --json` prints it."""
    stage = stage_object(result)
    return {
        "outcome": CERTIFIED if stage["certified"] else stage["status"],
        "race_time_s": stage["race_time_s"],
        "message": stage["message"],
        "iterations": stage["iterations"],
        "ways": stage.get("ways") or [],
    }


def done(job: Job) -> Record:
    """The record of a job, but for its seconds."""
    inputs = inputs_of(job.course, job.overrides, job.search)
    race = changed(inputs.race, job.change)
    if job.starts:
        starts = solved_roughly(race, inputs.settings, job.course, job.starts, threads=job.threads)
        return {"outcome": "solved", "race_time_s": None, "starts": starts}
    if job.refine is not None:
        return record_of(refined(race, inputs.settings, job.course, job.refine, threads=job.threads))
    results = optimize(race, inputs.settings, until=Stage.POINT_MASS, threads=job.threads, progress=Silent())
    return record_of(list(results)[-1])


def main() -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the solver process is ended, too
    job = Job.read(sys.argv[1])
    started = time.perf_counter()
    try:
        record = done(job)
    except (InputError, ValueError) as error:
        record = {"outcome": "refused", "race_time_s": None, "message": str(error)}
    except AirraceError as error:
        record = {"outcome": "died", "race_time_s": None, "message": str(error)}
    print(json.dumps({**record, "seconds": time.perf_counter() - started}))


if __name__ == "__main__":
    main()
