"""Settings that a process makes before it loads a library."""

import os
import subprocess
import sys

import pytest

from airrace.process import CREATED, ONE_THREAD

SETTLED = "import gc, os; print(gc.get_threshold()[0], *(os.environ[name] for name in {names}))"
COUNTED = "import numpy, os; numpy.ones((300, 300)) @ numpy.ones((300, 300)); print(len(os.listdir('/proc/self/task')))"


def said(program: str, **variables: str) -> str:
    environment = {name: value for name, value in os.environ.items() if name not in ONE_THREAD} | variables
    ran = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return ran.stdout.strip()


def test_what_nobody_has_set_is_settled() -> None:
    program = f"from airrace import process; process.settle(); {SETTLED.format(names=tuple(ONE_THREAD))}"
    assert said(program) == f"{CREATED} 1 1 1 1"


def test_what_the_user_has_set_stays() -> None:
    program = f"from airrace import process; process.settle(); {SETTLED.format(names=('OPENBLAS_NUM_THREADS',))}"
    assert said(program, OPENBLAS_NUM_THREADS="3") == f"{CREATED} 3"


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted as Linux tells them")
@pytest.mark.parametrize("entry", ["__main__", "memory"])
def test_processes_settle_before_they_load_numpy(entry: str) -> None:
    # What a process imports in its first line, its `main` would settle too late.
    loaded = said(f"import sys, airrace.{entry}; print('numpy' in sys.modules)")
    assert loaded == "False"
    assert said(f"from airrace import process; process.settle(); {COUNTED}") == "1"
