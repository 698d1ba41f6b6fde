"""What stand-ins on the workers of a cluster have left behind: when each was started, and by which process."""

from pathlib import Path


class Log:
    """Every start of a stand-in."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def lines(self) -> list[list[str]]:
        return [line.split() for line in self.path.read_text().splitlines()] if self.path.exists() else []

    def of(self, name: str) -> list[str]:
        """How each process of a job began: `new` or `resumed`."""
        return [how for one, _, _, how in self.lines if one == name]

    def processes(self) -> list[int]:
        return [int(process) for _, process, _, _ in self.lines]

    def workers(self, name: str) -> list[int]:
        """The process of the worker of each start of a job."""
        return [int(worker) for one, _, worker, _ in self.lines if one == name]
