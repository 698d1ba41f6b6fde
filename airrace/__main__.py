"""The entry point: `airrace` and `python -m airrace`.

Requests to stop are listened to before the libraries are imported, which takes up to a second.
"""

import atexit
import contextlib
import os
import sys

from airrace.runtime import interrupts


def main() -> None:
    """Run the command line and end the process with its exit code."""
    interrupts.listen()
    try:
        from airrace.runtime import process

        process.omit_memory_tracebacks()
        process.configure()
        process.ensure_memory()
        from airrace.pages.views.plain_text import secure

        secure()
        from airrace.cli.main import run

        code = run()
        sys.stdout.flush()
    except SystemExit:
        raise
    except BaseException as error:
        code = exit_code(error)
    if code == interrupts.EXIT_CODE and not interrupts.acknowledged():  # no command has said why
        sys.stderr.write("airrace: interrupted\n")
    interrupts.close()
    # Of `sys.exit` all but taking apart what was loaded: of 0.20 s of processor time of `--help` that is 0.04 s, of
    # 1.6 s of `check` 0.4 s. And after an interrupt within an `exec`, Python would end by the signal.
    atexit._run_exitfuncs()  # pyright: ignore[reportPrivateUsage]
    with contextlib.suppress(OSError):  # stdout was flushed before, and there is nobody to report stderr to
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def exit_code(error: BaseException) -> int:
    """Say what ended the command line outside of a command, whose own errors are part of its result; return the code.

    Raises:
        BaseException: the error, if it is neither a request to stop nor one of stdout.
    """
    if interrupts.caused(error):
        return interrupts.EXIT_CODE
    from airrace.errors import is_lack_of_memory
    from airrace.runtime.process import SYSTEM_ERROR

    if is_lack_of_memory(error):
        sys.stderr.write("airrace: out of memory\n")
        return SYSTEM_ERROR
    if isinstance(error, OSError):
        from airrace.runtime.standard_streams import abandon_stdout

        abandon_stdout()
        if isinstance(error, BrokenPipeError):  # the reader has seen enough
            return 0
        sys.stderr.write(f"airrace: cannot write to stdout: {error.strerror}\n")
        return SYSTEM_ERROR
    raise error


if __name__ == "__main__":
    main()
