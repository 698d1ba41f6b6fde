"""`stand_in_job.py` for a job whose folder vanishes with it: every start adds a line to a file of the test's.

`python cluster_stand_in.py LOG FD`; a line is: name, process, process of the worker, `resumed` or `new`.
"""

import ctypes
import io
import json
import os
import signal
import sys
from pathlib import Path

import stand_in_job


def main() -> None:
    if sys.platform == "linux":  # as a real one, it ends with its worker
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    log = Path(sys.argv.pop(1))
    text = sys.stdin.read()
    order = json.loads(text)
    resumed = "resumed" if Path(order["checkpoint"]).exists() else "new"
    with log.open("a") as starts:  # one short write: lines of several processes do not mix
        starts.write(f"{order['job']['name']} {os.getpid()} {os.getppid()} {resumed}\n")
    sys.stdin = io.StringIO(text)
    stand_in_job.main()


if __name__ == "__main__":
    main()
