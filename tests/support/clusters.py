"""Clusters on loopback for the tests: a real scheduler and real workers, each a process that can be killed."""

import json
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

from waiting import wait_until


class Cluster:
    """A scheduler, and workers as they are asked for; a context manager that leaves no process behind."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._workers: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Self:
        self._folder.mkdir(parents=True, exist_ok=True)
        file = self._folder / "scheduler.json"
        options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
        self._scheduler = self._started("dask_scheduler", *options)
        wait_until(lambda: file.exists() and file.read_text().rstrip().endswith("}"))
        self.address: str = json.loads(file.read_text())["address"]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in (*self._workers, self._scheduler):
            process.kill()
            process.wait()

    def worker(self, threads: int = 1) -> "subprocess.Popen[bytes]":
        """A worker without a nanny: killed, it stays dead."""
        folder = self._folder / f"worker-{len(self._workers)}"
        process = self._started(
            "dask_worker",
            self.address,
            *("--host", "127.0.0.1", "--nthreads", str(threads), "--no-nanny", "--no-dashboard"),
            *("--memory-limit", "0", "--local-directory", str(folder)),
        )
        self._workers.append(process)
        return process

    def kill_scheduler(self) -> None:
        self._scheduler.kill()
        self._scheduler.wait()

    def _started(self, module: str, *options: str) -> "subprocess.Popen[bytes]":
        with (self._folder / "log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-P", "-m", f"distributed.cli.{module}", *options],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                cwd=self._folder,
                start_new_session=True,
            )
