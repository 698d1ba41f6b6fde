"""Settings that a process makes before it loads a library."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from waiting import PATIENCE

from airrace.runtime.process import COLLECTION_THRESHOLD, ONE_THREAD, available_cores

SETTINGS = "import gc, os; print(gc.get_threshold()[0], *(os.environ[name] for name in {names}))"
COUNTED = "import numpy, os; numpy.ones((300, 300)) @ numpy.ones((300, 300)); print(len(os.listdir('/proc/self/task')))"


def said(program: str, **variables: str) -> str:
    environment = {name: value for name, value in os.environ.items() if name not in ONE_THREAD} | variables
    ran = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return ran.stdout.strip()


@pytest.mark.parametrize(
    ("names", "variables", "expected"),
    [(tuple(ONE_THREAD), {}, "1 1 1 1"), (("OPENBLAS_NUM_THREADS",), {"OPENBLAS_NUM_THREADS": "3"}, "3")],
    ids=["set", "left to the user"],
)
def test_what_the_user_has_not_set_is_configured(
    names: tuple[str, ...], variables: dict[str, str], expected: str
) -> None:
    program = f"from airrace.runtime import process; process.configure(); {SETTINGS.format(names=names)}"
    assert said(program, **variables) == f"{COLLECTION_THRESHOLD} {expected}"


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted as Linux tells them")
@pytest.mark.parametrize("entry", ["__main__", "runtime.process"])
def test_processes_settle_before_they_load_numpy(entry: str) -> None:
    # What a process imports in its first line, its `main` would settle too late.
    loaded = said(f"import sys, airrace.{entry}; print('numpy' in sys.modules)")
    assert loaded == "False"
    assert said(f"from airrace.runtime import process; process.configure(); {COUNTED}") == "1"


@pytest.mark.parametrize(
    ("membership", "files", "cores"),
    [
        pytest.param("0::/", {"cpu.max": "150000 100000"}, 2, id="quota of a container, version 2"),
        pytest.param("0::/a/b", {"a/b/cpu.max": "max 100000", "a/cpu.max": "300000 100000"}, 3, id="of a parent"),
        pytest.param("0::/a/b", {"a/cpu.max": "300000 100000", "cpu.max": "50000 100000"}, 1, id="least of several"),
        pytest.param("0::/", {"cpu.max": "max 100000"}, 8, id="no quota"),
        pytest.param(
            "1:cpu,cpuacct:/docker/x\n0::/",
            {"cpu,cpuacct/cpu.cfs_quota_us": "200000", "cpu,cpuacct/cpu.cfs_period_us": "100000"},
            2,
            id="version 1",
        ),
        pytest.param(
            "1:cpu:/", {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, 8, id="none in version 1"
        ),
        pytest.param("4:memory:/", {"memory/cpu.max": "100000 100000"}, 8, id="another controller"),
        pytest.param("", {}, 8, id="no control groups"),
    ],
)
def test_no_more_cores_are_counted_than_a_quota_pays_for(
    membership: str, files: dict[str, str], cores: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("airrace.runtime.process._affine_cores", lambda: 8)
    monkeypatch.setattr(os, "process_cpu_count", lambda: 8, raising=False)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{text}\n")
    (tmp_path / "membership").write_text(f"{membership}\n")
    assert available_cores(str(tmp_path / "membership"), str(tmp_path)) == cores


PROGRAM = """
import signal, sys, time
from airrace.runtime import interrupts

def swallowing():
    try:
        signal.raise_signal(signal.{name})
        time.sleep(600.0)
    except KeyboardInterrupt:
        pass  # as casadi does while it looks at its arguments
    time.sleep(600.0)

def turning():
    try:
        signal.raise_signal(signal.{name})
        time.sleep(600.0)
    except KeyboardInterrupt:
        raise NotImplementedError("wrong number or type of arguments") from None

class Finalised:
    def __del__(self):
        signal.raise_signal(signal.{name})
        time.sleep(0.1)

def finalising():
    Finalised()
    time.sleep(600.0)

def tidying():
    try:
        signal.raise_signal(signal.{name})
        time.sleep(600.0)
    finally:
        for _ in range(4):  # pressed again and again, and repeated in between
            signal.raise_signal(signal.{name})
            time.sleep(0.2)
        print("tidy", flush=True)

interrupts.listen()
try:
    {what}()
    print("never asked")
except BaseException as error:
    print(interrupts.caused(error), flush=True)
    interrupts.acknowledge()
signal.raise_signal(signal.{name})
time.sleep(2.0 * interrupts.REPEAT_INTERVAL)
print("acknowledged")
"""


REPEATED = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="requests are not repeated here")


@pytest.mark.parametrize(
    ("what", "name", "lines"),
    [
        pytest.param("swallowing", "SIGINT", [], marks=REPEATED),
        pytest.param("finalising", "SIGINT", [], marks=REPEATED),
        ("turning", "SIGTERM", []),
        ("tidying", "SIGINT", ["tidy"]),
    ],
)
def test_a_request_is_raised_until_acknowledged_even_if_swallowed_turned_into_an_error_or_made_meanwhile(
    what: str, name: str, lines: list[str]
) -> None:
    program = PROGRAM.format(what=what, name=name)
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=PATIENCE)
    assert ran.stderr == ""
    assert ran.stdout.splitlines() == [*lines, "True", "acknowledged"]


def test_nobody_listens_who_has_not_asked() -> None:
    program = (
        "from airrace.runtime import interrupts; import signal; "
        "print(interrupts.listening(), signal.getsignal(2).__name__)"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout == "False default_int_handler\n"
