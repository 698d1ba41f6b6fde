"""The address of a designer in a file beside its track file, locked while it runs: one track file, one designer.

A designer that was killed leaves it behind. The next one takes the same address, so that pages that are still open find
it again and hand their edits back.
"""

import json
import os
import re
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from airrace.errors import UsageError

try:
    import fcntl
except ModuleNotFoundError:  # Windows, where two designers of one file are not told apart
    fcntl = None

SIZE_MAX = 1000
"""What is read of the file, characters; an address has a tenth of it."""
TOKEN = re.compile(r"[\w-]{32}", re.ASCII)
PORT_MAX = 65535


class AddressFile:
    """The address of the designer of a track file; without effect in a folder that cannot be written.

    Attributes:
        port, token: of a designer that was killed; 0 and empty if there was none.

    Raises:
        UsageError: another designer has this track file open.
    """

    def __init__(self, track: Path) -> None:
        self._path = track.with_name(f".{track.name}.design")
        self._file = self._locked(track)
        self.port, self.token = (0, "") if self._file is None else _address(self._file)

    def write(self, port: int, token: str) -> None:
        """Note the address of this designer."""
        if self._file is not None:
            with suppress(OSError):
                self._file.seek(0)
                self._file.truncate()
                self._file.write(json.dumps({"port": port, "token": token}))
                self._file.flush()

    def close(self) -> None:
        """Remove the file: the designer ends as it should."""
        if self._file is not None:
            if fcntl:  # removed while it is locked, so that no other process holds it then
                with suppress(OSError):
                    self._path.unlink()
            self._file.close()
            if not fcntl:
                with suppress(OSError):
                    self._path.unlink()
            self._file = None

    def _locked(self, track: Path) -> IO[str] | None:
        """Return the file, open and locked; None where the system does not give it."""
        while True:
            try:
                if self._path.exists() and not self._path.is_file():  # a pipe might block
                    return None
                file = open(self._path, "a+", encoding="utf-8", errors="replace", opener=_private)  # noqa: SIM115  # until the end
            except OSError:
                return None
            try:
                if fcntl:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                port, token = _address(file)
                file.close()
                place = f" at http://127.0.0.1:{port}/{token}/" if port else ""
                raise UsageError(f"{track} is open in another designer{place}: use that, or end it first") from error
            except OSError:  # no locks on this file system
                return file
            with suppress(OSError):
                if os.path.samestat(os.fstat(file.fileno()), os.stat(self._path)):
                    return file
            file.close()  # its designer has removed it meanwhile


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


def _address(file: IO[str]) -> tuple[int, str]:
    """Return the port and the token in a file; 0 and nothing where it holds none."""
    file.seek(0)
    try:
        content: Any = json.loads(file.read(SIZE_MAX))  # whatever lies there
        port, token = content["port"], content["token"]
    except (ValueError, TypeError, KeyError, RecursionError):
        return 0, ""
    is_address = type(port) is int and 0 < port <= PORT_MAX and isinstance(token, str) and TOKEN.fullmatch(token)
    return (port, token) if is_address else (0, "")
