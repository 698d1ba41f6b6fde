"""The entry point: `airrace` and `python -m airrace`.

Signals and streams are seen to before anything else is imported, which takes up to a second.
"""

# What a terminal sends while even `signal` is still loaded waits until somebody listens. This is the part of `signal`
# in machine code, which is there from the beginning.
_signal = __import__("_signal")
if hasattr(_signal, "pthread_sigmask"):
    _signal.pthread_sigmask(_signal.SIG_BLOCK, (_signal.SIGINT, _signal.SIGTERM))

import os  # noqa: E402
import sys  # noqa: E402

from airrace import interrupts  # noqa: E402

TYPE_CHECKING = False  # as type checkers take it: `typing` is not loaded before requests are listened to
if TYPE_CHECKING:
    from typing import NoReturn

INTERRUPTED = 130
"""The exit code of a command that was asked to stop, as `ExitCode` has it; that is not imported yet."""


def main() -> None:
    """Run the command line and end the process with its exit code."""
    interrupts.listen()
    try:
        interrupts.let_through()
        from airrace import memory, process

        memory.tell_no_traceback()
        process.settle()
        memory.ensure_enough()
        from airrace.views.streams import secure

        secure()
        from airrace.cli.main import run

        code = run()
        sys.stdout.flush()
    except SystemExit:
        raise
    except BaseException as error:
        code = _ended_by(error)
    if code == INTERRUPTED and not interrupts.heard():  # no command has said why
        sys.stderr.write("airrace: interrupted\n")
    _leave(code)


def _leave(code: int) -> "NoReturn":
    """End the process at once, after all that is to be done at its end.

    `sys.exit` would take what was loaded apart first, which lasts a tenth of a second. And after an interrupt within
    the text of an `exec`, such as that of a dataclass, Python would send itself the signal at its very end, although it
    was heard.
    """
    import atexit
    import contextlib

    interrupts.close()
    atexit._run_exitfuncs()  # pyright: ignore[reportPrivateUsage] what sys.exit would do
    with contextlib.suppress(OSError):  # stdout was flushed before, and nobody can be told of stderr
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def _ended_by(error: BaseException) -> int:
    """Say what ended the command line outside of a command, whose own errors are part of its answer; return the code.

    Raises:
        BaseException: the error, if it is neither a request to stop nor one of stdout.
    """
    if interrupts.caused(error):
        return INTERRUPTED
    from airrace.errors import is_lack_of_memory

    if is_lack_of_memory(error):
        sys.stderr.write("airrace: out of memory\n")
        return 8
    if isinstance(error, OSError):
        from airrace.views.streams import abandon_stdout

        if not isinstance(error, BrokenPipeError):  # a reader that has seen enough needs no telling
            sys.stderr.write(f"airrace: cannot write to stdout: {error.strerror}\n")
        abandon_stdout()
        return 8
    raise error


if __name__ == "__main__":
    main()
