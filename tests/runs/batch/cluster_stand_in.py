"""`stand_in_job.py` for a job whose folder vanishes with it: every start adds a line to a file of the test's.

`python cluster_stand_in.py LOG`; a line is: name, process, process of the worker, `resumed` or `new`. One manner
more: `hang-first` hangs when it is started for the first time.
"""

import ctypes
import io
import json
import os
import signal
import sys
import time
from pathlib import Path

import stand_in_job


def main() -> None:
    if sys.platform == "linux":  # as a real one, it ends with its worker
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    log = Path(sys.argv.pop(1))
    text = sys.stdin.readline()
    order = json.loads(text)
    name, checkpoint = order["job"]["name"], Path(order["checkpoint"])
    first = not log.exists() or f"{name} " not in log.read_text()
    with log.open("a") as starts:  # one short write: lines of several processes do not mix
        starts.write(f"{name} {os.getpid()} {os.getppid()} {'resumed' if checkpoint.exists() else 'new'}\n")
    if stand_in_job.behaviour(order["job"]) == "hang-first" and first:
        time.sleep(600.0)
    sys.stdin = io.StringIO(text)
    stand_in_job.main()


if __name__ == "__main__":
    main()
