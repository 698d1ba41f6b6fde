"""Takes from every module of airrace what a system other than POSIX lacks; the libraries beneath keep it.

A folder of `PYTHONPATH` with this file does it to a process and to all that it starts. What airrace imports is a
stand-in for the module, without the names that are missing there.
"""

import builtins
import sys
import warnings
from types import ModuleType
from typing import Any

MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "select", "selectors", "syslog", "termios", "tty"}
NAMES = {
    "os": """
        O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK WNOHANG chown chroot confstr fchmod fchown fork forkpty getegid
        geteuid getgid getgroups getloadavg getpgid getpgrp getpriority getsid getuid killpg lchown lockf mkfifo nice
        openpty pipe2 posix_spawn pread preadv pwrite register_at_fork sched_getaffinity sched_setaffinity sendfile
        set_blocking setpgid setpriority setsid setuid statvfs sync sysconf tcgetpgrp ttyname uname wait wait3 wait4
        waitid
    """,
    "signal": """
        ITIMER_REAL SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 SIG_BLOCK
        SIG_UNBLOCK alarm pause pthread_kill pthread_sigmask setitimer sigpending sigwait
    """,
    "time": "clock_gettime pthread_getcpuclockid tzset",
}


class StandIn(ModuleType):
    """A module without some of its names, and with others in the place of its own."""

    def __init__(self, module: ModuleType) -> None:
        super().__init__(module.__name__)
        lacking = NAMES.get(module.__name__, "").split()
        self.__dict__.update(_module=module, _lacking=lacking, **others_of(module))

    def __getattr__(self, name: str) -> Any:
        if name in self._lacking:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r} without POSIX")
        return getattr(self._module, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._module, name, value)


def others_of(module: ModuleType) -> dict[str, Any]:
    """What stands in the place of a module's own names."""
    if module.__name__ == "ctypes":

        class CDLL(module.CDLL):  # type: ignore[name-defined]
            def __init__(self, name: str | None, *args: Any, **options: Any) -> None:
                if name is None:
                    raise TypeError("there is no one library")
                super().__init__(name, *args, **options)

        return {"CDLL": CDLL}
    if module.__name__ == "subprocess":

        class Popen(module.Popen):  # type: ignore[name-defined]
            def __init__(self, *args: Any, **options: Any) -> None:
                if options.keys() & {"pass_fds", "preexec_fn", "process_group", "user", "umask"}:
                    raise ValueError("not supported without POSIX")
                super().__init__(*args, **options)

        return {"Popen": Popen}
    return {}


stand_ins: dict[str, ModuleType] = {}
imported = builtins.__import__


def imported_by(
    name: str,
    globals: dict[str, Any] | None = None,
    locals: dict[str, Any] | None = None,
    fromlist: tuple[str, ...] = (),
    level: int = 0,
) -> ModuleType:
    """Import a module as airrace would find it elsewhere."""
    by = globals if globals is not None else sys._getframe(1).f_globals
    importer = getattr(by.get("__spec__"), "name", None) or str(by.get("__name__"))
    module = imported(name, globals, locals, fromlist, level)
    if importer.partition(".")[0] != "airrace":
        return module
    if module.__name__ in MODULES:
        raise ModuleNotFoundError(f"No module named {name!r} without POSIX", name=name)
    if module.__name__ in (*NAMES, "ctypes", "subprocess"):
        if module.__name__ not in stand_ins:
            stand_ins[module.__name__] = StandIn(module)
        return stand_ins[module.__name__]
    return module


builtins.__import__ = imported_by
warnings.filterwarnings("ignore", category=EncodingWarning)
warnings.filterwarnings("error", category=EncodingWarning, module=r"airrace\.")
