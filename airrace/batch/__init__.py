"""Batches of many courses: which jobs there are, who runs them, what is done already, and what came of it.

    sources -> jobs -> planning --- jobs ---> supervision <--- events --- an executor (local.py, cluster.py)
                           ^                     |
                           +----- records <------+------> reports

A `Job` is plain data and complete in itself: it can travel. `supervision.py` decides what runs, runs again or is
reused, and writes the records; it knows nothing of processes. An `Executor` flies jobs, somewhere; it
knows nothing of records.
**Another executor** is one class with the methods of `supervision.Executor`, which says what it may rely on and what it
owes. `local.LocalExecutor` flies jobs on the computer it runs on, and needs a folder to write to and nothing else.
"""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from airrace.errors import InputError, UsageError

if TYPE_CHECKING:
    from airrace.batch.planning import BatchPlan, Sources
    from airrace.batch.reports import BatchResult
    from airrace.batch.supervision import Executor, JobResult, Watcher

Sweeps = Mapping[str, str | Sequence[str | float]] | Sequence[str]
"""The values of keys: `{"rules.n_z_max": [9, 10]}`, `{"rules.n_z_max": "9:12:1"}` or `["rules.n_z_max=9:12:1"]`."""


def sweep_texts(sweep: Sweeps) -> list[str]:
    """Return sweeps as `key=values` texts, as `--sweep` takes them."""
    if not isinstance(sweep, Mapping):
        return [sweep] if isinstance(sweep, str) else list(sweep)
    lists = {key: values if isinstance(values, str) else ",".join(map(str, values)) for key, values in sweep.items()}
    return [f"{key}={values}" for key, values in lists.items()]


@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """The options of the command `batch`, by its words; `optimize_many` says what they mean.

    `set` and `sweep` are `key=value` and `key=values` texts.
    """

    courses: Sequence[str]
    aircraft: Sequence[Path] = ()
    settings: Path | None = None
    set: Sequence[str] = ()
    sweep: Sequence[str] = ()
    until: str | None = None
    jobs: int | None = None
    output: Path = Path("batch")
    cluster: str | None = None
    timeout: float | None = None
    retries: int = 1
    retry_failed: bool = False
    force: bool = False

    def sources(self) -> "Sources":
        """Return the courses that are meant.

        Raises:
            InputError: a sweep is not valid.
            UsageError: there is no such stage, or no time for a job.
        """
        from airrace.runs.execute import ensure_time

        ensure_time(self.timeout)
        from airrace.batch.planning import Manner, find_sources, parse_sweeps
        from airrace.runs.plan import stage_by_name

        manner = Manner(tuple(self.aircraft), self.settings, tuple(self.set), parse_sweeps(self.sweep), self.until)
        sources = find_sources(self.courses, manner)
        for group in sources.groups:
            stage_by_name(group.manner.until)
        return sources

    def plan(self, sources: "Sources") -> "BatchPlan":
        """Return the plan of the batch; see `planning.make_plan`."""
        from airrace.batch.planning import make_plan
        from airrace.batch.record import Choice
        from airrace.runs.plan import stage_by_name
        from airrace.runs.stored_inputs import library_versions

        choice = Choice.ALL if self.force else Choice.FAILED if self.retry_failed else Choice.NONE
        versions = ", ".join(f"{name} {number}" for name, number in library_versions().items())
        return make_plan(sources, self.output, until=stage_by_name(None).value, versions=versions, choice=choice)

    def executor(self) -> "Executor":
        """Return who flies the jobs; a cluster is given as long to have a worker as a job has to end.

        Raises:
            UsageError: dask.distributed is not installed.
        """
        from airrace.batch.local import JOB_COMMAND, LocalExecutor
        from airrace.process import available_cores
        from airrace.runs.stored_inputs import library_versions

        if self.cluster is None:
            return LocalExecutor(JOB_COMMAND, self.jobs or available_cores())
        try:
            from airrace.batch.cluster import ClusterExecutor
        except ModuleNotFoundError as error:
            raise UsageError("--cluster needs dask.distributed: pip install 'airrace[cluster]'") from error
        return ClusterExecutor(self.cluster, JOB_COMMAND[1:], library_versions(), self.jobs, self.timeout)

    def checked_plan(self, ensure: Callable[["BatchPlan"], None]) -> "BatchPlan":
        """Return the plan, and refuse what `fly` would refuse before a job runs, but a cluster that does not answer.

        Args:
            ensure: refuses a plan by raising.

        Raises:
            InputError, UsageError, StorageError: no job could run.
        """
        from airrace.batch.record import ensure_folder

        sources = self.sources()
        self.executor()
        ensure_folder(self.output)
        plan = self.plan(sources)
        ensure(plan)
        return plan

    def fly(
        self,
        watcher: Callable[[], contextlib.AbstractContextManager["Watcher"]],
        stopping: Callable[[], contextlib.AbstractContextManager[Callable[[], bool]]],
        ensure: Callable[["BatchPlan"], None],
    ) -> "tuple[BatchPlan, Sequence[JobResult]]":
        """Plan the batch and run its jobs, with the folder locked.

        Args:
            watcher: who watches, entered when the first job begins.
            stopping: provides a function that tells whether to stop.
            ensure: refuses a plan by raising.

        Raises:
            InputError, UsageError, ClusterError, StorageError: no job can run.
        """
        from airrace.batch.record import lock_folder
        from airrace.batch.supervision import supervise

        sources = self.sources()
        with self.executor() as executor, lock_folder(self.output):
            plan = self.plan(sources)
            ensure(plan)
            with stopping() as stop_asked, watcher() as watched:
                return plan, supervise(plan, executor, self, watched, stop_asked=stop_asked)


def optimize_many(
    tracks: str | Path | Sequence[str | Path],
    *,
    aircraft: str | Path | Sequence[str | Path] = (),
    winds: Mapping[str, str | Sequence[str | float]] | None = None,
    sweep: Sweeps = (),
    set: Mapping[str, str | int | float | bool] | Sequence[str] = (),
    settings: str | Path | None = None,
    until: str | None = None,
    jobs: int | None = None,
    output: str | Path = "batch",
    cluster: str | None = None,
    timeout: float | None = None,
    retries: int = 1,
    retry_failed: bool = False,
    force: bool = False,
) -> "list[BatchResult]":
    """Fly many courses, each with every aircraft, in every wind and with all swept values, as `airrace batch` does.

    Every combination is a job with a checkpoint of its own. A second call flies only what is not finished, or has
    changed.

    Examples:
        >>> winds = {"speed_kt": [10], "from_deg": [90, 270]}
        >>> results = airrace.optimize_many("half_cuban_eight", winds=winds, until="homotopy")
        >>> sorted(one.swept["environment.wind.from_deg"] for one in results)
        ['270', '90']
        >>> airrace.open(results[0].checkpoint)["homotopy"].name
        'homotopy'

    Args:
        tracks: track files, patterns, names of courses that come along, or batch files.
        aircraft: files or names; empty for what the tracks name.
        winds: values of `speed_kt`, `speed_m_s` and `from_deg`: a list, or a range `first:last:step`.
        sweep: values of any other keys, see `Sweeps`.
        set: single values for all jobs, see `optimize`.
        settings: a settings file; None for the defaults.
        until: the last stage, e.g. `point-mass`; None for the last one, `six-dof`.
        jobs: jobs at a time; None for all cores, or all threads of the cluster's workers.
        output: the folder of checkpoints and records.
        cluster: the address of a scheduler of dask.distributed; None for this computer.
        timeout: the longest wall time of a job, s; None for none.
        retries: how often a job is tried again whose process crashed.
        retry_failed: whether jobs are repeated that ended without a certified flight.
        force: whether all jobs are repeated from their start.

    Returns:
        One result per job, course by course, the fastest first. A job that fails is a result, too: its `state` and
        `message` say how it ended.

    Raises:
        InputError: a pattern, a batch file or a sweep is not valid.
        UsageError: no such stage, two jobs of one name, or a folder that another batch works in.
        ClusterError: the scheduler cannot be reached.
        StorageError: the system refused to write.
    """
    from airrace.batch.reports import ranking_of
    from airrace.batch.supervision import Watcher
    from airrace.runs.plan import value_texts

    def refuse(plan: "BatchPlan") -> None:
        if plan.findings:
            raise InputError(list(plan.findings))

    wind = {f"environment.wind.{key}": values for key, values in (winds or {}).items()}
    options = BatchOptions(
        courses=[str(one) for one in ([tracks] if isinstance(tracks, str | Path) else tracks)],
        aircraft=[Path(one) for one in ([aircraft] if isinstance(aircraft, str | Path) else aircraft)],
        settings=None if settings is None else Path(settings),
        set=value_texts(set),
        sweep=[*sweep_texts(wind), *sweep_texts(sweep)],
        until=until,
        jobs=jobs,
        output=Path(output),
        cluster=cluster,
        timeout=timeout,
        retries=retries,
        retry_failed=retry_failed,
        force=force,
    )
    plan, results = options.fly(
        lambda: contextlib.nullcontext(Watcher()), lambda: contextlib.nullcontext(lambda: False), refuse
    )
    return ranking_of(plan, results)
