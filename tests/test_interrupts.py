"""A request to stop reaches the command, whatever a library does with it, and reaches it once."""

import signal
import subprocess
import sys

import pytest
from waiting import PATIENCE

PROGRAM = """
import signal, sys, time
from airrace import interrupts

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
        for _ in range(4):  # pressed again and again, and reminded in between
            signal.raise_signal(signal.{name})
            time.sleep(0.2)
        print("tidy", flush=True)

interrupts.listen()
try:
    {what}()
    print("never asked")
except BaseException as error:
    print(interrupts.caused(error), flush=True)
    interrupts.hear()
signal.raise_signal(signal.{name})
time.sleep(2.0 * interrupts.REMINDER)
print("heard once")
"""


def said(what: str, name: str = "SIGINT") -> list[str]:
    """The lines of a program that is interrupted in a function of that name."""
    program = PROGRAM.format(what=what, name=name)
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=PATIENCE)
    assert ran.stderr == ""
    return ran.stdout.splitlines()


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="requests are not repeated here")
def test_a_request_that_is_swallowed_is_repeated() -> None:
    assert said("swallowing") == ["True", "heard once"]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="requests are not repeated here")
def test_a_request_within_a_finalizer_is_repeated_without_a_word() -> None:
    assert said("finalising") == ["True", "heard once"]


def test_an_error_that_a_request_was_turned_into_is_a_request() -> None:
    assert said("turning", "SIGTERM") == ["True", "heard once"]


def test_what_is_put_in_order_meanwhile_is_not_interrupted_again() -> None:
    assert said("tidying") == ["tidy", "True", "heard once"]


def test_nobody_listens_who_has_not_asked() -> None:
    program = (
        "from airrace import interrupts; import signal; print(interrupts.listening(), signal.getsignal(2).__name__)"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout == "False default_int_handler\n"


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals cannot be held back here")
def test_what_comes_before_anybody_listens_is_heard_later() -> None:
    """The request is made while the module is loaded whose `main` listens."""
    program = """
import signal, sys
class Late:
    def find_spec(self, name, path=None, target=None):
        if name == "airrace.interrupts":
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Late())
import airrace.__main__
airrace.__main__.main()
"""
    ran = subprocess.run([sys.executable, "-c", program, "tracks"], capture_output=True, text=True, timeout=PATIENCE)
    assert (ran.returncode, ran.stdout, ran.stderr) == (130, "", "airrace: interrupted\n")
